"""The CPU-first network that makes pictures finer: start, cost, linearity, export."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.bicubic import Bicubic
from camkit.models_def.networks.sub_pixel import (
    SUB_PIXEL_M,
    SUB_PIXEL_S,
    SubPixel,
    SubPixelConfig,
)
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph

CONFIGS = {"s": SUB_PIXEL_S, "m": SUB_PIXEL_M}


def _awake(config: SubPixelConfig) -> SubPixel:
    """Make a network as after training: nothing is 0."""
    torch.manual_seed(4)
    network = SubPixel(config).eval()
    for parameter in network.parameters():
        nn.init.normal_(parameter, std=0.05)
    return network


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
@pytest.mark.parametrize("phase", [0, 2])
def test_a_new_network_is_bicubic_away_from_the_border(config: SubPixelConfig, phase: int) -> None:
    planes = torch.rand(2, 2, 9, 11)
    found = SubPixel(replace(config, phase=phase))(planes)
    inner = np.s_[..., 8:-8, 8:-8]
    assert torch.allclose(found[inner], Bicubic(4, phase)(planes[:, :1])[inner], atol=1e-6)


@cache
def _exported(config: SubPixelConfig) -> tuple[SubPixel, bytes]:
    network = _awake(config)
    return network, to_onnx(network, channels=2, scale=4)


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_the_exported_graph_is_admitted_and_gives_what_torch_gives(
    config: SubPixelConfig,
) -> None:
    network, model = _exported(config)
    facts = inspect_graph(model)
    assert facts.parameters == sum(p.numel() for p in network.parameters())
    # two 3x3 at the ends, two in every block; the skip reaches 3
    assert facts.receptive_field_radius_px == 2 + 2 * config.blocks
    assert facts.stride_px == 1
    planes = np.random.default_rng(0).random((1, 2, 32, 64), np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(planes)).numpy()
    found = NetworkEngine(model, threads=1, scale=4).run(planes)
    assert found.shape == (1, 1, 128, 256)
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(("name", "kmac"), [("s", 5.0), ("m", 16.0)])
def test_a_sub_pixel_costs_what_is_stated(name: str, kmac: float) -> None:
    facts = inspect_graph(_exported(CONFIGS[name])[1])
    assert facts.mac_per_pixel / 16 / 1000 == pytest.approx(kmac, rel=0.05)


def test_the_skip_is_linear_and_reaches_three_pixels() -> None:
    network = _awake(SUB_PIXEL_S)
    nn.init.zeros_(network.tail.weight)
    planes = torch.zeros(1, 2, 15, 15)
    even = network(planes)
    planes[0, 1, 7, 7] = 1
    once = network(planes) - even
    twice = network(2 * planes) - even
    assert torch.allclose(twice, 2 * once, atol=1e-6)
    touched = once[0, 0].abs() > 1e-9
    assert touched[16:44, 16:44].all()
    assert touched.sum() == 28**2


def test_one_plane_alone_will_do() -> None:
    assert SubPixel(replace(SUB_PIXEL_S, in_channels=1))(torch.rand(1, 1, 5, 6)).shape == (
        *(1, 1),
        *(20, 24),
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 24}, "width must be a multiple of 16; got 24"),
        ({"width": 0}, "multiple of 16"),
        ({"blocks": -1}, "blocks must be >= 0"),
        ({"in_channels": 0}, "in_channels >= 1"),
    ],
)
def test_impossible_shape_is_refused(changes: dict[str, int], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        replace(SUB_PIXEL_S, **changes)


def test_a_phase_outside_the_pixel_is_refused() -> None:
    with pytest.raises(ContractError, match="phase must be"):
        SubPixel(replace(SUB_PIXEL_S, phase=4))

"""A network near lights: at work on them, not there at all elsewhere."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.networks.lean_unet import LeanUnet
from camkit.models_def.networks.near_lights import (
    BESIDE_PX,
    FLOOR,
    LEAST,
    RATIO,
    REACH_PX,
    NearLights,
    least,
    nearness,
)
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph

SIDE = 256
LIGHT = np.s_[..., 100:103, 120:124]


def _planes(lift: float = 1.04) -> Tensor:
    """Give a capture, and the same a little brighter."""
    rgb = torch.rand(1, 3, SIDE, SIDE, generator=torch.Generator().manual_seed(1)) + 0.1
    return torch.cat([rgb, lift * rgb], dim=1)


def _lit() -> Tensor:
    planes = _planes()
    planes[:, 3:][LIGHT] = 5
    return planes


def _awake(name: str) -> nn.Module:
    """Give a network that changes every pixel; a new one changes none."""
    torch.manual_seed(0)
    network = build_network(name, bias=True).eval()
    for parameter in network.parameters():
        if not parameter.any():
            nn.init.normal_(parameter, std=0.05)
    return network


@pytest.mark.parametrize("name", ["lights_s", "lights_m"])
def test_lights_and_pixels_beside_them_change_and_no_others(name: str) -> None:
    with torch.no_grad():
        out, lit = _awake(name)(_lit()), _lit()[:, 3:]
    changed = (out != lit).any(dim=1)[0].numpy()
    wanted = np.zeros((SIDE, SIDE), np.bool_)
    wanted[99:104, 119:125] = True
    np.testing.assert_array_equal(changed, wanted)
    assert BESIDE_PX + 2 < REACH_PX + 1


def test_light_that_streaks_took_away_wakes_no_network() -> None:
    planes = _planes(1.0 / 0.85**0.5)  # what a core of 85 % gains on an even plane
    assert (nearness(planes) == 0).all()


def test_whatever_rises_enough_in_one_colour_is_a_light() -> None:
    planes = _planes(1.0)
    planes[0, 4, 50, 60] = RATIO * planes[0, 1, 50, 60] + 2 * FLOOR + 1e-4
    assert nearness(planes)[0, 0, 50, 60] == 1
    planes[0, 4, 50, 60] -= FLOOR / 2
    assert 0.4 < float(nearness(planes)[0, 0, 50, 60]) < 0.6


def test_windows_have_the_bits_of_the_whole() -> None:
    model = to_onnx(_awake("lights_s"))
    facts, engine = inspect_graph(model), NetworkEngine(model, threads=1)
    assert facts.global_operators == facts.unblocked_convolutions == ()
    halo = -(-facts.receptive_field_radius_px // facts.stride_px) * facts.stride_px
    planes = _lit().numpy()
    whole = engine.run(planes)
    for top, left in ((64, 72), (64, 128)):
        window = planes[..., top - halo : top + 64 + halo, left - halo : left + 64 + halo]
        got = engine.run(np.ascontiguousarray(window))[..., halo:-halo, halo:-halo]
        np.testing.assert_array_equal(got, whole[..., top : top + 64, left : left + 64])


def test_one_picture_is_not_enough() -> None:
    with pytest.raises(ContractError, match="takes capture and lit, 6 channels; got 3"):
        build_network("lights_s", in_channels=3)


def test_no_light_is_darker_than_it_was_captured_and_nothing_beside_it_goes_out() -> None:
    """However dark the network inside would make them."""

    class Dark(LeanUnet):
        def forward(self, x: Tensor) -> Tensor:
            return torch.full_like(x[:, 3:], -100)

    awake = _awake("lights_s")
    assert isinstance(awake, NearLights)
    network = NearLights(Dark(awake.inner.config))
    planes = _lit()
    rgb, lit = planes[:, :3], planes[:, 3:]
    out = network(planes)
    torch.testing.assert_close(out[LIGHT], rgb[LIGHT])
    ring = np.s_[..., 99, 119:125]
    torch.testing.assert_close(out[ring], LEAST * rgb[ring])
    assert (least(planes) <= lit).all()

"""A network near lights: at work beside them, not there at all farther off."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.networks.near_lights import FLOOR, RATIO, REACH_PX, nearness
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
def test_pixels_out_of_reach_come_out_as_they_went_in(name: str) -> None:
    with torch.no_grad():
        out, lit = _awake(name)(_lit()), _lit()[:, 3:]
    changed = (out != lit).any(dim=1)[0].numpy()
    rows, columns = np.nonzero(changed)
    assert changed[LIGHT[1:]].all()
    assert rows.min() > 100 - REACH_PX
    assert rows.max() < 103 + REACH_PX
    assert columns.min() > 120 - REACH_PX
    assert columns.max() < 124 + REACH_PX
    assert changed.sum() > 64**2


def test_it_acts_fully_beside_a_light_and_less_and_less_farther_off() -> None:
    near = nearness(_lit())[0, 0]
    assert (near[88:112, 110:136] == 1).all()
    line = near[101, 124:]
    assert (line[1:] <= line[:-1]).all()
    assert line[REACH_PX] == 0


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

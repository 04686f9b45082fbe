"""Slanted edges: areas against fine sampling, both ways round."""

import math

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.scenes.slanted_edge import LEVELS, slanted_edge

FINE = 64


@pytest.mark.parametrize("angle_deg", [0.0, 3.5, -20.0, 45.0, 70.0])
def test_a_pixel_holds_the_share_of_its_area_beyond_the_edge(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    edge = slanted_edge(9, 11, angle_rad=angle, levels=(0, 1))
    y, x = ((np.arange(n * FINE) + 0.5) / FINE - n / 2 for n in (9, 11))
    beyond = x[None] * math.cos(angle) - y[:, None] * math.sin(angle) > 0
    share = beyond.reshape(9, FINE, 11, FINE).mean((1, 3))
    np.testing.assert_allclose(edge[1], share, atol=1.5 / FINE)
    assert edge.mean() == pytest.approx(0.5, abs=1e-6)


def test_a_level_edge_is_an_upright_one_turned_over() -> None:
    upright = slanted_edge(20, 30)
    np.testing.assert_array_equal(
        slanted_edge(30, 20, along_columns=False), upright.transpose(0, 2, 1)
    )
    assert (upright[0, 0, 0], upright[0, 0, -1]) == pytest.approx(LEVELS)
    # it moves to larger x with y
    assert upright[0, 0].sum() > upright[0, -1].sum()


@pytest.mark.parametrize(
    "wrong", [{"height": 0}, {"angle_rad": math.pi / 2}, {"levels": (-0.1, 1.0)}]
)
def test_what_is_no_edge_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ContractError, match="an edge needs"):
        slanted_edge(**({"height": 8, "width": 8} | wrong))  # type: ignore[arg-type]

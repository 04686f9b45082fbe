"""Slanted edges against the transforms of known blurs."""

import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.sensors.forward import blur
from camkit.report.edge_mtf import edge_mtf
from tools.tables.lenses.slanted_edge import (
    LEVELS,
    Across,
    EdgeContrast,
    edge_contrast,
    slanted_edge,
)

CUT = slice(15, -15)


def _blurred(across: Across, sigma_y_px: float, sigma_x_px: float) -> EdgeContrast:
    edge = slanted_edge(222, across)
    place = torch.arange(31, dtype=torch.float64) - 15
    down, right = (torch.exp(-0.5 * (place / s) ** 2) for s in (sigma_y_px, sigma_x_px))
    kernel = down[:, None] * right
    spread = blur(edge[None], (kernel / kernel.sum()).expand(1, 3, -1, -1))[0]
    return edge_contrast(spread[1], edge[1, CUT, CUT], across)


@pytest.mark.parametrize("across", ["tangential", "sagittal"])
def test_contrast_of_a_gaussian_blur_is_its_transform(across: Across) -> None:
    found = _blurred(across, 2.0, 2.0)
    expected = torch.exp(-2 * math.pi**2 * 4 * found.cycles_per_px**2)
    assert torch.allclose(found.contrast, expected, rtol=0, atol=2e-3)
    assert bool(found.falls)


def test_tangential_edges_see_the_blur_along_y() -> None:
    """Narrow across x: the edge between rows is soft, that between columns nearly sharp."""
    tangential, sagittal = (_blurred(a, 3.0, 0.3) for a in ("tangential", "sagittal"))
    assert float(tangential.contrast[10]) < 0.1
    assert float(sagittal.contrast[10]) > 0.9


def test_sharp_edge_has_full_contrast_and_one_pixel_in_between() -> None:
    edge = slanted_edge(128, "sagittal")[1]
    found = edge_contrast(edge, edge, "sagittal")
    assert torch.allclose(found.contrast, torch.ones_like(found.contrast), rtol=0, atol=1e-12)
    assert (float(edge.min()), float(edge.max())) == pytest.approx(LEVELS)
    assert int(((edge > LEVELS[0] + 1e-9) & (edge < LEVELS[1] - 1e-9)).sum(1).max()) <= 2


def test_half_of_the_light_spread_evenly_is_half_of_the_contrast() -> None:
    edge = slanted_edge(128, "tangential")[1]
    found = edge_contrast(0.5 * edge + 0.2, edge, "tangential")
    assert torch.allclose(found.contrast, torch.full_like(found.contrast, 0.5), rtol=1e-9)


def test_sharpening_is_told_by_its_maximum_and_its_rise() -> None:
    """Unsharp masking of a blur: 1 + a (1 - G), which grows above 1 and does not fall."""
    edge = slanted_edge(222, "tangential")
    place = torch.arange(31, dtype=torch.float64) - 15
    line = torch.exp(-0.5 * (place / 3) ** 2)
    kernel = (line[:, None] * line / line.sum() ** 2).expand(1, 3, -1, -1)
    soft = blur(edge[None], kernel)[0][1]
    sharp = edge[1, CUT, CUT]
    found = edge_contrast(sharp + 0.5 * (sharp - soft), sharp, "tangential")
    assert float(found.largest) == pytest.approx(1.5, abs=5e-3)
    assert not bool(found.falls)
    # the first frequency has some of the gain already
    first = 1 + 0.5 * (1 - math.exp(-2 * math.pi**2 * 9 * 0.02**2))
    assert float(found.rise) == pytest.approx(1.5 - first, abs=5e-3)


def test_small_pictures_are_refused_with_the_size_needed() -> None:
    edge = slanted_edge(64, "tangential")[1]
    with pytest.raises(ContractError, match="at least 84 px"):
        edge_contrast(edge, edge, "tangential")


def test_the_contrast_of_a_known_edge_is_its_mtf_over_that_of_the_sharp_one() -> None:
    """`edge_mtf` must find the edge, and starts from 1 at frequency 0; the rest is the same."""
    edge = slanted_edge(222, "sagittal")
    place = torch.arange(31, dtype=torch.float64) - 15
    line = torch.exp(-0.5 * (place / 1.5) ** 2)
    kernel = (line[:, None] * line / line.sum() ** 2).expand(1, 3, -1, -1)
    soft, sharp = blur(edge[None], kernel)[0][1], edge[1, CUT, CUT]
    found = edge_contrast(soft, sharp, "sagittal")
    cycles = found.cycles_per_px.numpy()
    over = edge_mtf(soft.numpy(), cycles_per_px=cycles).mtf
    under = edge_mtf(sharp.numpy(), cycles_per_px=cycles).mtf
    assert torch.allclose(found.contrast, torch.from_numpy(over / under), rtol=0, atol=5e-3)

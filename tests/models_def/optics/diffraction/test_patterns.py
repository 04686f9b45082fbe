"""Patterns write what they say: where, and how much of the light."""

import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import (
    CrossPattern,
    FlatPattern,
    PeakPattern,
    StarPattern,
)
from camkit.models_def.optics.diffraction.shares import find_streaks
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf

BENCH = Bench(diameter_mm=4.0, focal_length_mm=50.0)
CELLS, PITCH_UM, INDEX = 512, 6.0, 1.46
GRID = PixelGrid(side_px=151, pitch_um=PITCH_UM)


def _index_at(wavelength_um: float) -> float:
    del wavelength_um
    return INDEX


def _psf(height_um: torch.Tensor) -> torch.Tensor:
    return plate_psf(height_um, INDEX, 0.55, bench=BENCH, grid=GRID)


def _disc(psf: torch.Tensor, right_px: int, down_px: int, radius_px: int) -> float:
    place = torch.arange(151) - 75
    inside = (place[None] - right_px) ** 2 + (place[:, None] - down_px) ** 2 <= radius_px**2
    return float(psf[inside].sum())


def test_a_second_peak_lies_where_it_is_wanted_with_its_share() -> None:
    pattern = PeakPattern(right_um=30 * PITCH_UM, down_um=-12 * PITCH_UM, share=0.1)
    psf = _psf(pattern.height_um(BENCH, _index_at, CELLS))
    # its own rings, those of an aperture a third as wide, reach beyond eight pixels
    assert _disc(psf, 30, -12, 8) == pytest.approx(0.1, rel=0.15)
    assert _disc(psf, -30, 12, 8) < 0.01
    assert _disc(psf, 30, 12, 8) < 0.01
    assert _disc(psf, 0, 0, 8) == pytest.approx(0.9, rel=0.06)


def test_a_second_peak_of_a_square_aperture_takes_its_share_of_the_square() -> None:
    bench = Bench(diameter_mm=4.0, aperture="square", focal_length_mm=50.0)
    height_um = PeakPattern(right_um=180.0, down_um=0.0, share=0.1).height_um(
        bench, _index_at, CELLS
    )
    place = (torch.arange(CELLS) + 0.5) / CELLS - 0.5
    radius = (place[None] ** 2 + place[:, None] ** 2).sqrt()
    assert float(radius[height_um > 0].max()) == pytest.approx(math.sqrt(0.1 / math.pi), rel=0.02)


def test_the_cross_is_a_map_of_rank_one_and_writes_the_two_lines_of_gratings() -> None:
    lines = {"near_um": 60.0, "far_um": 360.0, "share": 0.06}
    cross = CrossPattern(**lines)
    made = cross.rank_map(BENCH, _index_at, CELLS)
    assert made.v.shape == (CELLS, 1)
    height_um = cross.height_um(BENCH, _index_at, CELLS)
    inner = torch.logit(height_um.double() / 1.125)
    values = torch.linalg.svdvals(inner)
    assert float(values[1] / values[0]) < 1e-4
    star = StarPattern(angles_deg=(0.0, 90.0), **lines).height_um(BENCH, _index_at, CELLS)
    cross_psf, star_psf, bare = (_psf(h) for h in (height_um, star, torch.zeros(CELLS, CELLS)))
    found = find_streaks(cross_psf, bare)
    assert sorted(round(streak.angle_deg) % 180 for streak in found) == [0, 90]
    assert _disc(cross_psf, 0, 0, 3) == pytest.approx(_disc(star_psf, 0, 0, 3), abs=0.004)


def test_a_flat_pattern_is_no_relief() -> None:
    assert FlatPattern().height_um(BENCH, _index_at, 8).tolist() == [[0.0] * 8] * 8


@pytest.mark.parametrize(
    ("share", "right_um", "message"),
    [(0.0, 10.0, "share between 0 and 1"), (0.1, 0.0, "a place beside the first")],
)
def test_what_is_no_second_peak_is_refused(share: float, right_um: float, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        PeakPattern(right_um=right_um, down_um=0.0, share=share)


def test_cells_too_wide_for_a_prism_are_refused_with_the_limit() -> None:
    pattern = PeakPattern(right_um=360.0, down_um=0.0, share=0.1)
    with pytest.raises(ContractError, match=r"at most 19\.1 um"):
        pattern.height_um(BENCH, _index_at, 128)

import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirped_gratings
from camkit.models_def.optics.diffraction.shares import find_streaks, shares
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf

GRID = PixelGrid(side_px=201, pitch_um=6.0)
BENCH = Bench(diameter_mm=4.0, focal_length_mm=50)


def _psf(angles_deg: tuple[float, ...], far_px: float = 60.0) -> torch.Tensor:
    streaks = Streaks(
        angles_rad=tuple(math.radians(a) for a in angles_deg),
        near_um=60.0,
        far_um=6 * far_px,
        share=0.06,
        wavelength_um=0.55,
        index=1.46,
    )
    height_um = chirped_gratings(streaks, BENCH, 512)().detach().float()
    return plate_psf(height_um, 1.46, 0.55, bench=BENCH, grid=GRID)


@pytest.fixture(scope="module")
def bare() -> torch.Tensor:
    return plate_psf(torch.zeros(512, 512), 1.46, 0.55, bench=BENCH, grid=GRID)


@pytest.mark.parametrize("angles", [(30.0,), (0.0, 90.0), (0.0, 45.0, 90.0, 135.0), (7.0, 100.0)])
def test_streaks_are_found_where_they_were_written(
    angles: tuple[float, ...], bare: torch.Tensor
) -> None:
    found = find_streaks(_psf(angles), bare)
    assert len(found) == len(angles)
    for streak, angle in zip(
        sorted(found, key=lambda s: (s.angle_deg + 3) % 180), angles, strict=True
    ):
        off = (streak.angle_deg - angle + 90) % 180 - 90
        assert abs(off) < 1.0
        assert streak.reach_px == pytest.approx(60, abs=4)


def test_a_longer_streak_reaches_farther(bare: torch.Tensor) -> None:
    reach = [find_streaks(_psf((0.0, 90.0), far), bare)[0].reach_px for far in (40.0, 80.0)]
    assert reach == pytest.approx([40, 80], abs=5)


def test_a_bare_lens_has_no_streaks(bare: torch.Tensor) -> None:
    assert find_streaks(bare, bare) == ()
    own = shares(bare, ())
    assert own.core > 0.9
    assert own.streak == 0


def test_shares_are_those_of_the_design(bare: torch.Tensor) -> None:
    psf = _psf((0.0, 90.0))
    streaks = find_streaks(psf, bare)
    made, own = shares(psf, streaks), shares(bare, streaks)
    assert made.core + made.streak + made.haze == pytest.approx(1.0)
    assert made.core / own.core == pytest.approx(0.94, abs=0.01)
    assert made.streak - own.streak == pytest.approx(0.06, abs=0.01)


def test_what_are_no_psfs_is_refused() -> None:
    for one, other in (((4, 4), (4, 4)), ((5, 5), (7, 7)), ((5, 7), (5, 7))):
        with pytest.raises(ContractError, match="one odd side"):
            find_streaks(torch.ones(one), torch.ones(other))

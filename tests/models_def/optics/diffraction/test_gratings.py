import math
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Aperture, Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirped_gratings
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index

PITCH_UM = 6.0
WAVE_UM = 0.55


def _index(wave_um: float) -> float:
    return float(refractive_index(find_glass("SILICA"), torch.tensor([wave_um])))


def _streaks(**changes: Any) -> Streaks:
    wanted: dict[str, Any] = {
        "angles_rad": (0.0, math.pi / 2),
        "near_um": 10 * PITCH_UM,
        "far_um": 60 * PITCH_UM,
        "share": 0.06,
        "wavelength_um": WAVE_UM,
        "index": _index(WAVE_UM),
    }
    return Streaks(**{**wanted, **changes})


def _bench(aperture: Aperture = "circle") -> Bench:
    return Bench(diameter_mm=4.0, aperture=aperture, focal_length_mm=50)


GRID = PixelGrid(side_px=201, pitch_um=PITCH_UM)


def _bare(bench: Bench, wave_um: float = WAVE_UM) -> torch.Tensor:
    return plate_psf(torch.zeros(512, 512), 1.46, wave_um, bench=bench, grid=GRID)


def _psf(streaks: Streaks, bench: Bench, wave_um: float = WAVE_UM) -> torch.Tensor:
    height_um = chirped_gratings(streaks, bench, 512)().detach().float()
    return plate_psf(height_um, _index(wave_um), wave_um, bench=bench, grid=GRID)


def _written(streaks: Streaks, bench: Bench, wave_um: float = WAVE_UM) -> torch.Tensor:
    """Give what the plate adds to the light of the bare lens, whose own halo is no streak."""
    made, bare = _psf(streaks, bench, wave_um), _bare(bench, wave_um)
    return made - bare * (made[100, 100] / bare[100, 100])


@pytest.mark.parametrize("aperture", ["circle", "square"])
def test_a_streak_lies_where_it_is_wanted_and_is_evenly_bright(aperture: Aperture) -> None:
    psf = _written(_streaks(), _bench(aperture))
    right = psf[96:105].sum(0)[101:]
    inside, outside = right[11:58], right[66:]
    assert float(inside.mean()) == pytest.approx(0.06 / 4 / 50, rel=0.1)
    # a chirp of few cycles rings: evenly bright over eight pixels
    eights = inside[:40].reshape(5, 8).mean(1)
    assert float((eights / inside.mean() - 1).abs().max()) < 0.2
    assert float(outside.mean()) < 0.05 * float(inside.mean())


@pytest.mark.parametrize("angles", [(0.4,), (0.0, 1.0), (0.0, 0.8, 1.6, 2.4)])
def test_the_share_is_taken_from_the_core(angles: tuple[float, ...]) -> None:
    bench = _bench()
    bare = _bare(bench)
    made = _psf(_streaks(angles_rad=angles), bench)
    core = (slice(96, 105), slice(96, 105))
    assert float(made[core].sum() / bare[core].sum()) == pytest.approx(0.94, abs=0.005)


def test_a_streak_turns_with_its_angle() -> None:
    psf = _written(_streaks(angles_rad=(math.radians(30),)), _bench())
    psf[90:111, 90:111] = 0
    place = torch.arange(201, dtype=torch.float32) - 100
    angle = torch.atan2(place[:, None], place[None, :])
    off = torch.remainder(torch.rad2deg(angle) - 30 + 90, 180) - 90
    assert float(psf[off.abs() < 5].sum() / psf.sum()) > 0.9


def test_colours_reach_by_wavelength_and_share_by_its_inverse_square() -> None:
    """Reach goes with the wavelength, the share with ((n - 1) / wavelength)^2."""
    blue, red = (_written(_streaks(), _bench(), wave) for wave in (0.47, 0.66))
    arms = [psf[96:105].sum(0)[101:] for psf in (blue, red)]
    reach = [int((arm > 0.3 * arm[15:40].mean()).nonzero().max()) for arm in arms]
    assert reach[1] / reach[0] == pytest.approx(0.66 / 0.47, rel=0.06)
    shares = [float(arm[6:].sum()) for arm in arms]
    expected = ((_index(0.47) - 1) / 0.47 * 0.66 / (_index(0.66) - 1)) ** 2
    assert shares[0] / shares[1] == pytest.approx(expected, rel=0.06)


def test_what_no_weak_grating_writes_is_refused() -> None:
    for wrong in (
        {"angles_rad": ()},
        {"near_um": -1.0},
        {"far_um": 10.0},
        {"share": 0.0},
        {"share": 0.5},
        {"index": 1.0},
        {"wavelength_um": math.nan},
    ):
        with pytest.raises(ContractError):
            _streaks(**wrong)
    with pytest.raises(ContractError, match=r"cells of 62\.5 um are too wide"):
        chirped_gratings(_streaks(), _bench(), 64)

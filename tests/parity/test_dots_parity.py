"""Dots photographed and summed at use time = the PSF that the design side says an array sees."""

import numpy as np
import pytest

from camkit.calibration.dots import see_dots
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.match import match_dots
from camkit.models_def.optics.dots.pattern import View, dot_picture
from camkit.models_def.optics.dots.target import likeness, to_target
from camkit.models_def.optics.dots.unit import DotPlate

CAMERA = DotCamera(cells=32, tiles=8)
# of the thesis: 3.45 um behind 50 mm; the point at 1.35 m is in focus
PHOTOGRAPH = PixelGrid(side_px=161, pitch_um=3.45, samples=5)
TARGET = to_target(gaussian_psf(1.84))
ERRORS = {"as designed": (0.0, 0.0, 0.0), "deeper": (0.08, 0.08, 0.08), "mixed": (-0.1, 0.05, 0.06)}


@pytest.fixture(name="plate", scope="module")
def eight_levels() -> DotPlate:
    return match_dots(TARGET, CAMERA, 8, np.random.default_rng(0), starts=1).plate


@pytest.mark.parametrize("errors", ERRORS.values(), ids=ERRORS)
def test_a_photograph_of_a_mis_etched_plate_gives_the_psf_that_it_has(
    plate: DotPlate, errors: tuple[float, ...]
) -> None:
    made_um = plate.etched_um(errors)
    true = effective_psf(made_um, CAMERA)
    photograph = dot_picture(made_um, CAMERA, PHOTOGRAPH)
    seen = see_dots(photograph, PHOTOGRAPH.pitch_um, TARGET)
    found = likeness(seen.kernel, true)
    assert found.correlation > 0.99999
    assert found.rmse < 0.0015
    assert seen.share == pytest.approx(true.sum() / photograph.sum(), rel=2e-3)
    # which is news: the plate is farther from its design than the photograph from the plate
    if any(errors):
        assert likeness(true, TARGET).rmse > 10 * found.rmse


def test_so_it_does_out_of_focus(plate: DotPlate) -> None:
    view = View(defocus_mm=0.2)
    true = effective_psf(plate.height_um, CAMERA, view)
    photograph = dot_picture(plate.height_um, CAMERA, PHOTOGRAPH, view)
    seen = see_dots(photograph, PHOTOGRAPH.pitch_um, TARGET)
    assert likeness(seen.kernel, true).rmse < 0.003

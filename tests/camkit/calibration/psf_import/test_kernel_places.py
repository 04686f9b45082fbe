"""Places of kernels that do not fit a sensor are noted."""

import numpy as np
import pytest

from camkit.calibration.psf_import.kernel_places import reach_note
from camkit.models_def.optics.measured import measured_psf


def grid(x_mm: float, y_mm: float):
    axes = np.linspace(-x_mm, x_mm, 5), np.linspace(-y_mm, y_mm, 3)
    return measured_psf(
        np.ones((3, 5, 1, 3, 3)), pixel_pitch_um=4.0, wavelengths_um=(0.54,), grid_mm=axes
    )


@pytest.mark.parametrize(
    ("half_mm", "words"),
    [
        ((6.0, 4.0), None),
        ((5.0, 3.0), None),
        ((9000.0, 6000.0), "in mm"),
        ((3.0, 4.0), "the outermost ones hold beyond"),
    ],
)
def test_kernels_beyond_the_sensor_or_short_of_it_are_noted(half_mm, words) -> None:
    note = reach_note(grid(*half_mm), 12.0, 8.0)
    assert (note is None) if words is None else (note is not None and words in note)


def test_one_place_is_everywhere() -> None:
    one = measured_psf(np.ones((1, 3, 3)), pixel_pitch_um=4.0, wavelengths_um=(0.54,))
    assert reach_note(one, 12.0, 8.0) is None

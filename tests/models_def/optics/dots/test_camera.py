import math

import pytest

from camkit.calibration.dots import ACTIVE_UM
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import WAVELENGTH_UM
from camkit.models_def.kinds.spad.sampling import FINE_PITCH_UM, PSF_SIDE
from camkit.models_def.optics.dots.camera import ORDERS, DotCamera


def test_a_unit_is_what_the_thesis_prints() -> None:
    camera = DotCamera()
    assert camera.unit_mm == pytest.approx(0.8733, abs=5e-5)
    assert camera.cell_um == pytest.approx(9.924, abs=5e-4)
    # section 4.3.3: an aperture of 14 mm gives dots of 2.34 um
    fringe_um = camera.wavelength_um * camera.focal_length_mm / (camera.tiles * camera.unit_mm)
    assert fringe_um == pytest.approx(2.34, abs=5e-3)


def test_a_level_of_eight_is_a_cycle_of_malitsons_silica_by_eight() -> None:
    camera = DotCamera()
    assert camera.index == pytest.approx(1.45640, abs=5e-6)
    assert camera.etching(8).step_um == pytest.approx(0.1794, abs=5e-5)
    assert camera.etching(8).step_um * 8 * (camera.index - 1) == pytest.approx(0.655)


def test_the_lattice_is_that_of_the_array() -> None:
    camera = DotCamera()
    assert (camera.spacing_um, camera.active_um) == (FINE_PITCH_UM, ACTIVE_UM)
    assert (camera.wavelength_um, ORDERS) == (WAVELENGTH_UM, PSF_SIDE)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"wavelength_um": 0.0}, "lengths must be > 0"),
        ({"focal_length_mm": math.inf}, "lengths must be > 0"),
        ({"active_um": 40.0}, "wider than the dots are apart"),
        ({"cells": 21}, "22 to 352 cells along a side; got 21"),
        ({"cells": 353}, "22 to 352"),
        ({"tiles": 0}, "tiles must be >= 1"),
        ({"glass": "no-glass"}, "no-glass"),
    ],
)
def test_what_is_no_camera_is_refused(wrong: dict, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        DotCamera(**wrong)

"""One door for all optics: what is asked for suits them, or is refused."""

import pytest

from camkit.bundle.sensor import Extent
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.freezer import FreezeRequest, freeze_optics
from camkit.models_def.optics.frozen import FreezeGrid
from camkit.models_def.optics.measured import MeasuredOptics
from tests.bundle_factory import tiny_psf
from tests.planes_bundle import planes_sensor

SENSOR = planes_sensor(("a",), extent=Extent(width_px=32, height_px=32, pixel_pitch_um=6.0))
MEASURED = MeasuredOptics(psf=tiny_psf(), name="measured")


def test_what_is_known_of_a_lens_alone_is_refused_of_others() -> None:
    with pytest.raises(UnsupportedError, match="only a lens is traced with its sensor moved"):
        freeze_optics(MEASURED, FreezeRequest(sensor=SENSOR, focus_um=10.0))
    with pytest.raises(UnsupportedError, match="haze is for lenses only"):
        freeze_optics(MEASURED, FreezeRequest(sensor=SENSOR, haze=True))


def test_with_haze_the_rest_is_chosen() -> None:
    with pytest.raises(ContractError, match="haze conflicts with depths_mm, energy"):
        FreezeRequest(sensor=SENSOR, haze=True, depths_mm=(1.0,), energy=0.9)


def test_who_says_how_much_light_is_wanted_gets_no_less() -> None:
    base = FreezeGrid(energy=0.999, max_side_px=401, least_energy=0.9)
    assert FreezeRequest(sensor=SENSOR).grid(base) == base
    asked = FreezeRequest(sensor=SENSOR, energy=0.95, max_side_px=101).grid(base)
    assert (asked.energy, asked.max_side_px, asked.least_energy) == (0.95, 101, None)


def test_what_is_not_searched_has_no_limit() -> None:
    with pytest.raises(ContractError, match="quick conflicts with limit_db, focus_um"):
        FreezeRequest(sensor=SENSOR, quick=True, limit_db=0.1, focus_um=3.0)

"""The thin plates that come with camkit hold the peaks that they promise."""

import math
from pathlib import Path

import pytest

from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.peak import Peak, measure_peak
from camkit.models_def.optics.thin.plate_lens import plate_lens
from camkit.models_def.optics.thin.report import with_ideal_grooves, with_midpoints
from camkit.models_def.optics.thin.solver import solve_plate
from camkit.models_def.optics.thin.thin_recipe import find_thin_recipe

PITCH_UM = 5.96


def _peaks(lens: Lens) -> list[Peak]:
    return [measure_peak(lens, a, 0.55, PITCH_UM) for a in with_midpoints(lens.field_angles_rad)]


def test_ideal_grooves_hold_an_eighth_of_the_light_in_every_field() -> None:
    shares = [p.within_px(10.0) for p in _peaks(with_ideal_grooves(find_lens("thin-plate")))]
    assert min(shares) >= 0.12
    assert max(shares) / min(shares) <= 1.6


def test_real_grooves_hold_a_tenth_and_the_haze_is_wide() -> None:
    peaks = _peaks(find_lens("thin-plate"))
    shares = [p.within_px(10.0) for p in peaks]
    assert min(shares) >= 0.10
    assert max(shares) / min(shares) <= 1.6
    assert peaks[0].within_px(450.0) > 0.98
    assert 0.5 < peaks[-1].within_px(450.0) < 0.6


def test_the_corner_of_the_sensor_is_reached() -> None:
    """6000 x 4000 pixels."""
    height = measure_peak(find_lens("thin-plate"), math.radians(28.6), 0.55, PITCH_UM).height_px
    assert height == pytest.approx(math.hypot(3000, 2000), rel=0.01)


def test_a_real_stop_keeps_the_peak_and_leaves_the_haze_out() -> None:
    peaks = _peaks(find_lens("thin-plate-stop"))
    assert min(p.within_px(10.0) for p in peaks) > 0.75
    # of the light of the open plate, the stop passes a ninth
    assert (7.8 / 23.4) ** 2 * peaks[0].within_px(10.0) == pytest.approx(0.111, abs=0.002)


@pytest.mark.parametrize("name", ["thin-plate", "thin-plate-single", "thin-plate-stop"])
def test_the_recipe_gives_the_prescription(name: str) -> None:
    recipe = find_thin_recipe(Path(f"{name.replace('-', '_')}_lens"))
    made, kept = plate_lens(recipe, solve_plate(recipe)), find_lens(name)
    assert (made.name, made.note) == (kept.name, kept.note)
    for a, b in zip(made.surfaces, kept.surfaces, strict=True):
        assert a.grooves == b.grooves
        assert a.thickness_mm == pytest.approx(b.thickness_mm, abs=0.02)
        for number, (x, y) in enumerate(zip(a.even_asphere, b.even_asphere, strict=True), start=1):
            assert abs(x - y) * 11.7 ** (2 * number) < 0.1

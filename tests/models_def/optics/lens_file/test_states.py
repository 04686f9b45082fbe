"""A lens with configurations: TOML, one state of several, scaling and focus."""

import math
from dataclasses import replace

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.focus import with_focus
from camkit.models_def.optics.lens_file.states import configuration_name, plain_lens, with_states
from camkit.models_def.optics.paraxial import paraxial_data, with_paraxial_focus
from camkit.models_def.optics.prescription import (
    Lens,
    format_prescription,
    parse_prescription,
    with_focus_shift,
)
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.scaling import scale_lens, with_f_number
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors, perturb

FIRST, SECOND = 50.0, -30.0
ZOOM = """
name = "zoom"
stop = 0
f_number = 8.0
field_angles_deg = [0.0, 5.0]
wavelengths_um = [0.55]
[[surface]]
radius_mm = 25.0
thickness_mm = 0.001
glass = "model:1.5,60"
semi_diameter_mm = 4.0
[[surface]]
radius_mm = inf
thickness_mm = 30.0
[[surface]]
radius_mm = -15.0
thickness_mm = 0.001
glass = "model:1.5,60"
[[surface]]
radius_mm = inf
thickness_mm = 60.0
[[configuration]]
name = "wide"
thickness_mm = { 1 = 25.0, 3 = 120.0 }
[[configuration]]
name = "2"
thickness_mm = { 1 = 35.0 }
semi_diameter_mm = { 0 = 6.0 }
object_distance_mm = 1e3
entrance_pupil_diameter_mm = 3.0
field_angles_deg = [0.0, 2.5]
"""


@pytest.fixture(name="zoom")
def fixture_zoom() -> Lens:
    return parse_prescription(ZOOM)


def test_a_state_changes_only_what_it_names(zoom: Lens) -> None:
    bare = replace(zoom, configurations=())
    wide, near = plain_lens(zoom, "wide"), plain_lens(zoom, "2")
    assert [s.thickness_mm for s in wide.surfaces] == [0.001, 25.0, 0.001, 120.0]
    assert [s.thickness_mm for s in near.surfaces] == [0.001, 35.0, 0.001, 60.0]
    gaps = tuple(
        replace(a, thickness_mm=b.thickness_mm)
        for a, b in zip(wide.surfaces, bare.surfaces, strict=True)
    )
    assert replace(wide, surfaces=gaps, name=bare.name, state="") == bare
    assert (near.object_distance_mm, near.surfaces[0].semi_diameter_mm) == (1e3, 6.0)
    assert (near.aperture_kind, near.aperture_value) == ("entrance_pupil_diameter_mm", 3.0)
    assert near.field_angles_rad == (0.0, math.radians(2.5))
    assert near.configurations == ()


def test_focal_lengths_are_those_of_two_thin_lenses(zoom: Lens) -> None:
    # the wavelength is near the line d of the model glass
    lens = replace(zoom, reference_wavelength_um=0.5875618)
    for name, gap_mm in (("wide", 25.0), ("2", 35.0)):
        power = 1 / FIRST + 1 / SECOND - gap_mm / (FIRST * SECOND)
        efl_mm = paraxial_data(plain_lens(lens, name)).efl_mm
        assert efl_mm == pytest.approx(1 / power, rel=1e-3)


def test_names_come_before_numbers_and_the_first_is_the_usual_one(zoom: Lens) -> None:
    assert configuration_name(zoom) == "wide"
    assert plain_lens(zoom, 1).name == "zoom (configuration wide)"
    assert plain_lens(zoom, 2) == plain_lens(zoom, "2")
    swapped = replace(zoom, configurations=zoom.configurations[::-1])
    assert configuration_name(swapped, "1") == "2"
    assert configuration_name(swapped, 2) == "2"
    assert configuration_name(replace(zoom, default_configuration="2")) == "2"


def test_unknown_states_are_refused_with_the_names_of_the_others(zoom: Lens) -> None:
    with pytest.raises(ContractError, match=r"one of wide, 2, or a number 1\.\.2; got 'tele'"):
        plain_lens(zoom, "tele")
    bare = plain_lens(zoom)
    assert plain_lens(bare) == bare
    with pytest.raises(ContractError, match="has no configurations"):
        plain_lens(bare, "wide")


def test_toml_gives_states_back(zoom: Lens) -> None:
    lens = replace(zoom, default_configuration="2")
    again = parse_prescription(format_prescription(lens))
    assert again == lens
    assert format_prescription(again) == format_prescription(lens)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('name = "2"', 'name = "wide"'), "names of their own"),
        (('name = "2"', 'name = " "'), "needs a name"),
        (("{ 1 = 35.0 }", "{ 4 = 35.0 }"), r"surfaces are 0\.\.3; got \[4\]"),
        (("{ 1 = 35.0 }", "{ last = 35.0 }"), "numbers of surfaces"),
        (("{ 1 = 35.0 }", '{ 1 = "35" }'), "configuration 2.thickness_mm.1 must be a number"),
        (("{ 1 = 35.0 }", "{ 1 = inf }"), "gaps must be finite"),
        (("{ 0 = 6.0 }", "{ 0 = -6.0 }"), "configuration 2: semi_diameter_mm must be > 0"),
        (("_diameter_mm = 3.0", "_diameter_mm = 3.0\nf_number = 4.0"), "at most one of"),
        (("stop = 0", 'stop = 0\ndefault_configuration = "tele"'), "one of wide, 2; got 'tele'"),
        (("object_distance_mm", "object_mm"), "unknown key 'object_mm'"),
    ],
)
def test_wrong_states_are_refused(change: tuple[str, str], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        plain_lens(parse_prescription(ZOOM.replace(*change)), 2)


def test_a_scaled_lens_is_scaled_in_every_state(zoom: Lens) -> None:
    for name in ("wide", "2"):
        small = paraxial_data(plain_lens(zoom, name))
        large = paraxial_data(plain_lens(scale_lens(zoom, 2.0), name))
        assert large.efl_mm == pytest.approx(2 * small.efl_mm)
        assert large.f_number == pytest.approx(small.f_number)
    assert plain_lens(scale_lens(zoom, 2.0), "2").object_distance_mm == 2e3


def test_a_moved_sensor_moves_in_every_state(zoom: Lens) -> None:
    moved = with_focus_shift(zoom, 0.5)
    assert plain_lens(moved, "wide").surfaces[-1].thickness_mm == 120.5
    assert plain_lens(moved, "2").surfaces[-1].thickness_mm == 60.5


def test_what_is_of_one_lens_refuses_several_states(zoom: Lens) -> None:
    with pytest.raises(ContractError, match="stop of fixed size is for one configuration"):
        with_fixed_stop(zoom)
    with pytest.raises(ContractError, match="one configuration"):
        with_f_number(zoom, 4.0)
    with pytest.raises(ContractError, match="of wide, 2"):
        with_focus(zoom, "spot")
    with pytest.raises(ContractError, match="of wide, 2"):
        with_paraxial_focus(zoom)
    with pytest.raises(ContractError, match="one configuration"):
        perturb(zoom, FabricationErrors(), np.random.default_rng(0))


def test_states_name_what_differs_and_give_their_lenses_back(zoom: Lens) -> None:
    states = {name: replace(plain_lens(zoom, name), name="zoom") for name in ("wide", "2")}
    lens = with_states(states["2"], states, "2")
    assert lens.configurations[0].thickness_mm == ((1, 25.0), (3, 120.0))
    assert lens.configurations[1].thickness_mm == ((1, 35.0), (3, 60.0))
    for name, one in states.items():
        assert replace(plain_lens(lens, name), name="zoom") == one

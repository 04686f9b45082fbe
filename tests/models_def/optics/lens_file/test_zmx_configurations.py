"""Configurations of .zmx files: read one by one or all, and written."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.lens_file.lens_file import (
    read_configured_lens,
    read_noted_lens,
    write_lens,
)
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.lens_file.zmx_reader import parse_zmx
from camkit.models_def.optics.lens_file.zmx_writer import format_zmx
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens
from tests.data_folder import data_path
from tests.models_def.optics.lens_file.test_states import ZOOM
from tests.zmx_factory import LA1131

LA1131_NAME = "LA1131 Plano-Convex - N-BK7 Ø25.4"
TAIL = "0 0 0 1 1 1 0 0"


def _file(*operands: str, head: str = "MNUM 2 1") -> str:
    lines = [head, *(f"{operand} {TAIL}" for operand in operands)]
    return LA1131.replace("MNUM 1 1", "\n".join(lines))


def test_each_configuration_is_the_file_with_its_values() -> None:
    text = _file("THIC 0 1 1E+10", "THIC 0 2 500", "THIC 2 1 44.2", "THIC 2 2 50", "APER 0 2 10")
    shown, near = parse_zmx(text).lens, parse_zmx(text, choice=2).lens
    assert replace(shown, name=LA1131_NAME, state="") == parse_zmx(LA1131).lens
    assert (near.object_distance_mm, near.surfaces[1].thickness_mm) == (500.0, 50.0)
    assert (near.aperture_value, near.surfaces[0].thickness_mm) == (10.0, 5.34)
    assert near.name.endswith("(configuration 2)")
    lens = parse_zmx(text, every=True).lens
    assert [state.name for state in lens.configurations] == ["1", "2"]
    assert plain_lens(lens) == shown
    assert plain_lens(lens, 2) == near


def test_the_configuration_that_a_file_shows_is_the_usual_one() -> None:
    text = _file("THIC 2 1 40", "THIC 2 2 44", head="MNUM 2 2")
    found = parse_zmx(text)
    assert found.lens.surfaces[1].thickness_mm == 44.20486329487
    assert found.lens.name.endswith("(configuration 2)")
    assert "2 configurations (1, 2): 2 is taken" in found.notes[-1]
    assert parse_zmx(text, choice="1").lens.surfaces[1].thickness_mm == 40.0
    assert parse_zmx(text, every=True).lens.default_configuration == "2"


def test_fields_of_a_configuration_are_its_own() -> None:
    text = _file("YFIE 1 1 0", "YFIE 1 2 7")
    assert parse_zmx(text, choice=2).lens.field_angles_rad == (math.radians(7.0),)


def test_a_wavelength_of_a_configuration_is_noted_and_no_wavelength_of_the_file() -> None:
    found = parse_zmx(_file("THIC 2 1 44", "THIC 2 2 50", "WAVE 1 1 0.5", "WAVE 1 2 0.6"))
    assert found.lens.wavelengths_um == (0.4861, 0.5876, 0.6563)
    assert any("WAVE of the configurations left out" in note for note in found.notes)


@pytest.mark.parametrize(
    ("operands", "head", "error", "message"),
    [
        (["THIC 9 2 1"], "MNUM 2 1", DecodeError, "THIC of surface 9"),
        (["THIC 2 3 1"], "MNUM 2 1", DecodeError, "THIC of configuration 3"),
        (["THIC 2 2 x"], "MNUM 2 1", DecodeError, "needs a finite number"),
        (["THIC 2.5 2 1"], "MNUM 2 1", DecodeError, "needs whole numbers"),
        (["THIC 2 2 1"], "MNUM 2 3", DecodeError, "shows configuration 3 of 2"),
        (["THIC 2 2 1"], "MNUM 101 1", UnsupportedError, "101 configurations"),
        (["YFIE 99 2 1"], "MNUM 2 1", DecodeError, "YFIE of field 99"),
    ],
)
def test_damaged_configurations_are_refused_with_their_line(
    operands: list[str], head: str, error: type[CamkitError], message: str
) -> None:
    with pytest.raises(error, match=rf"line \d+: .*{message}"):
        parse_zmx(_file(*operands, head=head))


def test_a_choice_needs_a_file_with_configurations() -> None:
    with pytest.raises(ContractError, match="for files that have some; got 2"):
        parse_zmx(LA1131, choice=2)
    with pytest.raises(ContractError, match="is one of 1, 2; got 'tele'"):
        parse_zmx(_file("THIC 2 1 44", "THIC 2 2 50"), choice="tele")


def test_a_configuration_that_camkit_does_not_read_is_left_out_with_a_note() -> None:
    found = parse_zmx(_file("THIC 0 1 1E+10", "THIC 0 2 -5"), every=True)
    assert [state.name for state in found.lens.configurations] == ["1"]
    assert any(note.startswith("configuration 2 left out: line") for note in found.notes)


def _zoom(tmp_path: Path, text: str = ZOOM) -> Lens:
    path = tmp_path / "zoom.toml"
    path.write_text(text)
    return read_configured_lens(path)[0]


def test_written_configurations_are_read_back(tmp_path: Path) -> None:
    # one kind of aperture, which is what the format holds
    text = ZOOM.replace("entrance_pupil_diameter_mm = 3.0", "f_number = 11.0")
    lens = _zoom(tmp_path, text.replace("semi_diameter_mm = { 0 = 6.0 }", "# no rim"))
    lens = replace(lens, default_configuration="2")
    text = format_zmx(lens)
    assert "MNUM 2 2\n" in text
    again = parse_zmx(text, every=True).lens
    for number in (1, 2):
        one, other = plain_lens(lens, number), plain_lens(again, str(number))
        angles = pytest.approx(one.field_angles_rad, rel=1e-14)
        assert other.field_angles_rad == angles
        same = replace(other, name=one.name, state=one.state, field_angles_rad=one.field_angles_rad)
        assert same == one


def test_a_stop_that_opens_is_written_with_its_rim(tmp_path: Path) -> None:
    text = ZOOM.replace("f_number = 8.0", "stop_semi_diameter_mm = 4.0")
    lens = _zoom(
        tmp_path, text.replace("entrance_pupil_diameter_mm = 3.0", "stop_semi_diameter_mm = 6.0")
    )
    again = parse_zmx(format_zmx(lens), every=True).lens
    assert [plain_lens(again, n).aperture_value for n in (1, 2)] == [4.0, 6.0]
    assert [plain_lens(again, n).surfaces[0].semi_diameter_mm for n in (1, 2)] == [4.0, 6.0]
    shut = replace(lens, aperture_value=3.0)
    with pytest.raises(UnsupportedError, match="rim that is not its aperture"):
        format_zmx(shut)


def test_what_the_format_does_not_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedError, match="of several kinds"):
        format_zmx(_zoom(tmp_path))
    text = ZOOM.replace("entrance_pupil_diameter_mm = 3.0", "f_number = 8.0")
    with pytest.raises(UnsupportedError, match="surface 2 has a rim in some"):
        format_zmx(_zoom(tmp_path, text.replace("{ 0 = 6.0 }", "{ 2 = 6.0 }")))
    with pytest.raises(ContractError, match="optiland's JSON is for one configuration"):
        write_lens(_zoom(tmp_path), tmp_path / "zoom.json")


def test_toml_is_read_in_the_usual_configuration_and_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "zoom.toml"
    path.write_text(ZOOM)
    lens, notes = read_noted_lens(path)
    assert lens.surfaces[1].thickness_mm == 25.0
    assert "2 configurations (wide, 2): wide is taken" in notes[0]
    lens, notes = read_noted_lens(path, configuration=2)
    assert lens.surfaces[1].thickness_mm == 35.0
    assert notes == ()


@pytest.mark.parametrize(
    ("name", "range_mm"),
    [
        ("Nikon_AF-S_Nikkor_24-85mm_f3.5-4.5G_ED_VR", (24, 85)),
        ("Tokina_AT-X_35-200mm_F3.5-4.5_AT-X352_", (35, 200)),
        ("Nikon_1_Nikkor_VR_10-30mm_f3.5-5.6", (10, 30)),
        ("Panasonic_Lumix_S_35mm_F1.8", (35, 35)),
    ],
)
def test_patents_are_in_focus_in_every_state_and_zoom_as_their_names_say(
    name: str, range_mm: tuple[float, float]
) -> None:
    # the image heights, whose aiming takes time, are left out
    text = data_path(f"lens_photo/{name}.zmx").read_text()
    lines = [line for line in text.splitlines() if not line.startswith(("XFLN", "YFLN"))]
    lens = parse_zmx("\n".join(lines), every=True).lens
    states = [plain_lens(lens, state.name) for state in lens.configurations]
    for state in states:
        gap_mm = state.surfaces[-1].thickness_mm
        assert gap_mm == pytest.approx(paraxial_image(state).distance_mm, abs=0.013)
    far = [paraxial_data(s).efl_mm for s in states if math.isinf(s.object_distance_mm)]
    assert (min(far), max(far)) == pytest.approx(range_mm, rel=0.05)

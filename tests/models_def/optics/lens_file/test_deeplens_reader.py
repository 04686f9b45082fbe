"""Files of DeepLens: its keys, its glasses, what is assumed and what is refused."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest

from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.agf import parse_agf
from camkit.models_def.optics.lens_file.deeplens_reader import parse_deeplens
from camkit.models_def.optics.lens_file.lens_file import read_noted_lens
from camkit.models_def.optics.paraxial import paraxial_data
from tests.data_folder import data_path

LENS: dict[str, Any] = {
    "info": "a made-up lens",
    "foclen": 40.0,
    "(d_sensor)": 64.0,
    "sensor_size": [12.0, 16.0],
    "surfaces": [
        {"type": "Spheric", "r": 8.0, "roc": 40.0, "(c)": 9.9, "d": 0.0, "mat2": "n-bk7"},
        {"type": "Spheric", "r": 8.0, "c": -0.02, "d": 5.0, "mat2": "1.6200/36.4", "d_next": 2.0},
        {
            "type": "Aspheric",
            "r": 7.0,
            "(c)": 0.0,
            "k": -1.5,
            "ai": [1e-4, -2e-6, 0.0],
            "d": 7.0,
            "mat2": "air",
        },
        {"type": "Aperture", "r": 4.0, "d": 8.0, "mat2": "occluder", "d_next": 1.0},
        {"type": "Plane", "r": 9.0, "d": 9.0, "mat2": "coc", "d_next": 1.5},
        {"type": "Plane", "r": 9.0, "d": 10.5, "mat2": "air"},
    ],
}


def _changed(*path: Any, value: Any) -> dict[str, Any]:
    table = copy.deepcopy(LENS)
    place: Any = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return table


def test_a_file_with_deeplens_s_keys_is_read() -> None:
    lens, notes = parse_deeplens(LENS, name="file")
    assert (lens.name, lens.note, lens.stop) == ("file", "a made-up lens", 3)
    assert (lens.aperture_kind, lens.aperture_value) == ("stop_semi_diameter_mm", 4.0)
    # roc holds where both stand; a gap is d_next, else the difference of the places
    assert [s.radius_mm for s in lens.surfaces] == [40, -50, *[math.inf] * 4]
    assert [s.thickness_mm for s in lens.surfaces] == [5, 2, 1, 1, 1.5, 53.5]
    glasses = ["N-BK7-Schott", "model:1.62,36.4", "air", "air", "COC-Misc", "air"]
    assert [s.glass for s in lens.surfaces] == glasses
    assert (lens.surfaces[2].conic, lens.surfaces[2].even_asphere) == (-1.5, (1e-4, -2e-6))
    assert [s.semi_diameter_mm for s in lens.surfaces] == [8, 8, 7, 4, 9, 9]
    efl_mm = paraxial_data(lens).efl_mm
    # the corner of 12 mm x 16 mm is 10 mm from the axis
    assert max(lens.field_angles_rad) == pytest.approx(math.atan(10 / efl_mm))
    stored, assumed = notes
    assert stored == f"the file states a focal length of 40 mm: it is {efl_mm:.5g} mm"
    assert "sensor's corner (10 mm)" in assumed


def test_a_wrong_f_number_of_the_file_is_noted() -> None:
    lens, notes = parse_deeplens(_changed("fnum", value=1.0))
    f_number = paraxial_data(lens).f_number
    assert notes[1] == f"the file states an F-number of 1: it is {f_number:.5g}"


def test_without_a_stop_the_surface_of_least_clear_radius_is_taken() -> None:
    surfaces = [block for block in LENS["surfaces"] if block["type"] != "Aperture"]
    lens, notes = parse_deeplens(LENS | {"surfaces": surfaces})
    assert (lens.stop, lens.aperture_value) == (2, 7.0)
    assert notes[0].startswith("no surface is a stop: surface 2 is taken")


def test_names_are_looked_for_as_deeplens_does_and_in_the_user_s_catalogue_first() -> None:
    table = _changed("surfaces", 0, "mat2", value="f2")
    assert parse_deeplens(table)[0].surfaces[0].glass == "F2-Schott"
    mine = parse_agf("NM F2 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n", "mine")
    assert parse_deeplens(table, [mine])[0].surfaces[0].material == mine.glasses[0]
    assert (
        parse_deeplens(_changed("surfaces", 0, "mat2", value="ps"))[0].surfaces[0].glass
        == "POLYSTYR-Misc"
    )
    with pytest.raises(ContractError, match=r"surface 0: .*'NOGLASS'"):
        parse_deeplens(_changed("surfaces", 0, "mat2", value="noglass"))
    with pytest.raises(ContractError, match="surface 0: "):
        parse_deeplens(_changed("surfaces", 0, "mat2", value="1.5/x"))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("surfaces", 0, "type"), "ThinLens", "surface 0 is of type ThinLens"),
        (("surfaces", 0, "type"), "Binary2", "surface 0 is of type Binary2"),
        (("surfaces", 3, "is_square"), True, "square stop"),
        (("DOE",), {"type": "Binary2"}, "a diffractive element"),
        (("surfaces",), [], "no surface"),
        (("surfaces", 0, "r"), "x", "surface 0: r must be a number"),
        (("surfaces", 5, "d"), None, "surface 4"),
        (("(d_sensor)",), None, "surface 5 must have d_next"),
        (("surfaces", 0, "type"), "Aperture", r"must be the stop; got \[0, 3\]"),
    ],
)
def test_what_camkit_does_not_trace_is_refused_by_name(
    path: tuple[Any, ...], value: Any, message: str
) -> None:
    table = _changed(*path, value=value)
    if message == "surface 4":
        del table["surfaces"][4]["d_next"]
    with pytest.raises((UnsupportedError, DecodeError), match=message):
        parse_deeplens(table)


def test_replaced_values_give_a_lens_or_an_expected_error() -> None:
    for i, block in enumerate(LENS["surfaces"]):
        for key in block:
            for value in (None, "x", -1, 0, 1e300, math.inf, math.nan, [], {}):
                try:
                    parse_deeplens(_changed("surfaces", i, key, value=value))
                except CamkitError:
                    continue


def test_the_suffix_and_the_keys_choose_the_reader(tmp_path: Path) -> None:
    path = tmp_path / "made_up.json"
    path.write_text(json.dumps(LENS))
    lens, _ = read_noted_lens(path)
    assert lens.name == "made_up"
    path.write_text(json.dumps(LENS | {"DOE": {"type": "x"}}))
    with pytest.raises(UnsupportedError, match=r"made_up\.json: DOE"):
        read_noted_lens(path)


def test_the_lens_of_a_file_that_exists_in_both_formats_is_one() -> None:
    """The EF 35 mm f/2 of lens_zmx is DeepLens' own; its first surfaces, written anew here."""
    lens, _ = read_noted_lens(data_path("lens_zmx/ef35mm_f2.0.zmx"))
    surfaces = [
        {
            "type": "Aperture" if i == lens.stop else "Spheric",
            "r": 20.0,
            "roc": 0 if math.isinf(s.radius_mm) else s.radius_mm,
            "mat2": s.glass.removeprefix("model:").replace(",", "/"),
            "d_next": s.thickness_mm,
        }
        for i, s in enumerate(lens.surfaces)
    ]
    back, _ = parse_deeplens({"surfaces": surfaces, "r_sensor": 21.6})
    wave = lens.reference_wavelength_um
    assert paraxial_data(back, wave).efl_mm == pytest.approx(
        paraxial_data(lens, wave).efl_mm, rel=1e-12
    )

"""Files of optiland: its field names, its glasses, what is refused, and the round trip."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.errors import CamkitError, ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.agf import parse_agf
from camkit.models_def.optics.glass.catalogue import builtin_catalogues, find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.glass.material import FORMULAS, Glass
from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, find_lens, read_lens
from camkit.models_def.optics.lens_file.optiland_glass import glass_table, read_glass_table
from camkit.models_def.optics.lens_file.optiland_reader import parse_optiland
from camkit.models_def.optics.lens_file.optiland_writer import optiland_table, write_optiland
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, Surface

WAVES_UM = (0.45, 0.55, 0.65)
UPRIGHT = {"x": 0.0, "y": 0.0, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": None}
AIR = {"type": "IdealMaterial", "index": 1.0, "absorp": 0.0}


def _surface(z_mm: float, material: dict[str, Any], **facts: Any) -> dict[str, Any]:
    """Return a surface with the field names of optiland 0.6.3."""
    geometry = {"type": "Plane", "cs": {**UPRIGHT, "z": z_mm}, "radius": math.inf}
    geometry |= facts.pop("geometry", {})
    base = {"type": "Surface", "geometry": geometry, "material_post": material, "comment": ""}
    model = {"type": "RefractiveReflectiveModel", "is_reflective": False}
    return base | {"is_stop": False, "aperture": None, "interaction_model": model} | facts


def _table() -> dict[str, Any]:
    glass = {
        "type": "Material",
        "name": "n-bk7",
        "reference": None,
        "catalog": None,
        "filename": "/any/where/database/data-nk/glass/schott/N-BK7.yml",
    }
    sphere = {"type": "StandardGeometry", "radius": 50.0, "conic": -0.5}
    asphere = {
        "type": "EvenAsphere",
        "radius": -80.0,
        "conic": 0.0,
        "coefficients": [1e-4, 2e-6, 0.0],
    }
    return {
        "version": 1.0,
        "name": None,
        "aperture": {"type": "EPD", "value": 10},
        "fields": {
            "fields": [{"x": 0.0, "y": y, "vx": 0.0, "vy": 0.0} for y in (0, 5, -14)],
            "telecentric": False,
            "field_definition": {"field_type": "AngleField"},
        },
        "wavelengths": {
            "wavelengths": [
                {"value": 656.3, "is_primary": False, "unit": "nm", "weight": 1.0},
                {"value": 0.55, "is_primary": True, "unit": "um", "weight": 1.0},
            ],
            "polarization": "ignore",
        },
        "pickups": [],
        "solves": {"solves": []},
        "surface_group": {
            "surfaces": [
                _surface(-math.inf, AIR, type="ObjectSurface"),
                _surface(0.0, glass, geometry=sphere, thickness=4, is_stop=True),
                _surface(
                    4.0,
                    AIR,
                    geometry=asphere,
                    aperture={"type": "RadialAperture", "r_max": 7.5, "r_min": 0},
                ),
                _surface(60.0, AIR),
            ]
        },
    }


def test_a_file_with_optiland_s_field_names_is_read() -> None:
    lens, notes = parse_optiland(_table(), name="file")
    assert notes == ()
    front, back = lens.surfaces
    assert (lens.name, lens.stop, lens.object_distance_mm) == ("file", 0, math.inf)
    assert (lens.aperture_kind, lens.aperture_value) == ("entrance_pupil_diameter_mm", 10)
    assert (front.radius_mm, front.conic, front.thickness_mm) == (50, -0.5, 4)
    assert (front.glass, back.glass) == ("N-BK7-Schott", "air")
    assert (back.thickness_mm, back.semi_diameter_mm) == (56, 7.5)
    assert back.even_asphere == (1e-4, 2e-6)
    assert lens.wavelengths_um == pytest.approx((0.55, 0.6563))
    assert lens.reference_wavelength_um == 0.55
    assert lens.field_angles_rad == pytest.approx([math.radians(a) for a in (0, 5, 14)])


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        ("imageFNO", 4, ("f_number", 4)),
        ("float_by_stop_size", 9, ("stop_semi_diameter_mm", 4.5)),
    ],
)
def test_apertures_are_those_of_optiland(
    kind: str, value: float, expected: tuple[str, float]
) -> None:
    table = _table() | {"aperture": {"type": kind, "value": value}}
    lens, _ = parse_optiland(table)
    assert (lens.aperture_kind, lens.aperture_value) == expected


def test_numerical_aperture_of_a_near_object_opens_the_entrance_pupil() -> None:
    table = _table() | {"aperture": {"type": "objectNA", "value": 0.1}}
    table["surface_group"]["surfaces"][0]["geometry"]["cs"]["z"] = -100.0
    lens, _ = parse_optiland(table)
    # the stop is the first surface, so it is the entrance pupil
    assert lens.aperture_value == pytest.approx(2 * 100 * math.tan(math.asin(0.1)))
    with pytest.raises(ContractError, match="near object"):
        parse_optiland(_table() | {"aperture": {"type": "objectNA", "value": 0.1}})


def _changed(*path: Any, value: Any) -> dict[str, Any]:
    table = copy.deepcopy(_table())
    place: Any = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return table


SURFACES = ("surface_group", "surfaces")


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ((*SURFACES, 1, "geometry", "type"), "OddAsphere", "surface 1 is of type OddAsphere"),
        ((*SURFACES, 2, "geometry", "cs", "rx"), 0.1, "surface 2 is tilted or decentred"),
        ((*SURFACES, 2, "geometry", "cs", "y"), 1.0, "surface 2 is tilted or decentred"),
        ((*SURFACES, 1, "interaction_model", "is_reflective"), True, "surface 1 is a mirror"),
        (
            (*SURFACES, 1, "interaction_model", "type"),
            "ThinLensInteractionModel",
            "surface 1 has a ThinLens",
        ),
        ((*SURFACES, 2, "aperture", "r_min"), 2.0, "surface 2 has a RadialAperture"),
        ((*SURFACES, 2, "aperture", "type"), "PolygonAperture", "has a PolygonAperture"),
        ((*SURFACES, 1, "material_post", "type"), "MaterialFile", "material MaterialFile"),
        ((*SURFACES, 3, "geometry", "radius"), -90.0, "the image is curved"),
        (("aperture", "type"), "imageNA", "aperture imageNA"),
        (("fields", "telecentric"), True, "telecentric"),
        (("fields", "field_definition", "field_type"), "Other", "fields are of kind Other"),
        (("wavelengths", "wavelengths"), [], "states no wavelength"),
        ((*SURFACES, 1, "is_stop"), False, "must be the stop; got none"),
        ((*SURFACES, 1, "geometry", "radius"), 0, "radius must not be 0"),
        ((*SURFACES, 1, "geometry", "radius"), "x", "surface 1: radius must be a number"),
        ((*SURFACES, 2, "geometry", "cs", "z"), math.nan, "surface 2: z must be a number"),
        ((*SURFACES, 2, "geometry", "coefficients"), ["a"], "coefficients must be a number"),
        ((*SURFACES,), [], "object, lens and image were expected; got 0"),
        ((*SURFACES,), 7, "surfaces must be a list"),
        ((*SURFACES, 1, "geometry"), 7, "geometry must be an object"),
    ],
)
def test_what_camkit_does_not_trace_is_refused_by_name(
    path: tuple[Any, ...], value: Any, message: str
) -> None:
    with pytest.raises((UnsupportedError, DecodeError), match=message):
        parse_optiland(_changed(*path, value=value))


def test_what_is_left_out_is_noted() -> None:
    table = _table()
    table["fields"]["fields"][1]["vy"] = 0.2
    table["pickups"] = [{"source": 1}]
    table["solves"] = {"solves": [{"type": "x"}]}
    _, notes = parse_optiland(table)
    assert [note.split()[0] for note in notes] == ["vignetting", "solves", "pickups"]


def _formula_index(table: dict[str, Any], wave: float) -> float:
    """Return the index by the formulas of refractiveindex.info, written out."""
    c = table["coefficients"]
    pairs = list(zip(c[1::2], c[2::2], strict=False))
    match table["formula"]:
        case "formula 2":
            return math.sqrt(1 + c[0] + sum(b * wave**2 / (wave**2 - g) for b, g in pairs))
        case "formula 3":
            return math.sqrt(c[0] + sum(a * wave**p for a, p in pairs))
        case "formula 4":
            square = c[0] + c[1] * wave ** c[2] / (wave**2 - c[3] ** c[4])
            square += c[5] * wave ** c[6] / (wave**2 - c[7] ** c[8])
            square += sum(a * wave**p for a, p in zip(c[9::2], c[10::2], strict=True))
            return math.sqrt(square)
        case "formula 5":
            return float(c[0] + sum(a * wave**p for a, p in pairs))
    pole = 1 / (wave**2 - 0.028)
    powers = sum(a * wave ** (2 * i) for i, a in enumerate(c[3:], start=1))
    return float(c[0] + c[1] * pole + c[2] * pole**2 + powers)


COEFFICIENTS = {
    "sellmeier": (1.04, 0.006, 0.23, 0.02, 1.01, 103.6),
    "sellmeier_offset": (1.2, 1.04, 0.006, 0.03, 0.02),
    "sellmeier_mixed": (0.3, 0.98, 0.1, 0.01, 0.2),
    "handbook_1": (2.2, 0.02, 0.03, 0.01),
    "handbook_2": (1.2, 1.05, 0.01, 0.01),
    "schott": (2.27, -0.01, 0.01, 2e-4, -4e-6, 4e-7),
    "powers": (2.2, 0.0, -0.01, 2.0, 0.011, -2.0),
    "cauchy": (1.5, 4e-3, 1e-4),
    "conrady": (1.48, 0.015, 5e-4),
    "herzberger": (1.5, 4e-3, 1e-5, -1e-3, 1e-5, -1e-6),
}


@pytest.mark.parametrize("formula", [f for f in FORMULAS if f not in ("constant", "buchdahl")])
def test_every_formula_goes_out_with_the_same_index(formula: str) -> None:
    glass = Glass(
        name="X-mine",
        formula=formula,  # type: ignore[arg-type]
        coefficients=COEFFICIENTS[formula],
        source="test",
        range_um=(0.4, 0.7),
    )
    dispersion = glass_table(glass, WAVES_UM)["definition"]["dispersion"]
    ours = refractive_index(glass, torch.tensor(WAVES_UM, dtype=torch.float64)).tolist()
    theirs = [_formula_index(dispersion, wave) for wave in WAVES_UM]
    assert theirs == pytest.approx(ours, rel=1e-14)


def test_a_glass_of_1983_goes_out_as_a_table_that_holds_the_lens_s_wavelengths() -> None:
    glass = find_glass("BAF13-Schott1983")
    assert glass.formula == "buchdahl"
    dispersion = glass_table(glass, WAVES_UM)["definition"]["dispersion"]
    indices = dict(zip(dispersion["wavelengths_um"], dispersion["indices"], strict=True))
    ours = refractive_index(glass, torch.tensor(WAVES_UM, dtype=torch.float64)).tolist()
    assert [indices[wave] for wave in WAVES_UM] == ours
    back = read_glass_table(glass_table(glass, WAVES_UM), "", "surface 1")
    assert back == glass


def test_a_maker_s_glass_goes_out_by_its_name_and_catalogue() -> None:
    table = glass_table(find_glass("N-BK7"), WAVES_UM)
    assert (table["type"], table["name"], table["catalog"]) == ("Material", "N-BK7", "schott")
    assert read_glass_table(table, "", "surface 1").name == "N-BK7-Schott"
    # a name that stands twice in optiland's catalogue goes out with its coefficients
    assert glass_table(find_glass("SF5-Schott"), WAVES_UM)["type"] == "DataMaterial"


def test_a_formula_that_has_no_name_of_a_catalogue_is_carried_by_the_lens(tmp_path: Path) -> None:
    data = {"dispersion": {"kind": "formula", "formula": "formula 1"}}
    data["dispersion"]["coefficients"] = [0.0, 1.2, 0.1]  # type: ignore[assignment]
    material = {"type": "DataMaterial", "definition": data, "name": "my glass"}
    table = _changed(*SURFACES, 1, "material_post", value=material)
    lens, _ = parse_optiland(table)
    medium = lens.surfaces[0].medium
    assert medium.name == "my glass-optiland"
    index = float(refractive_index(medium, torch.tensor(0.5, dtype=torch.float64)))
    assert index == pytest.approx(math.sqrt(1 + 1.2 * 0.25 / (0.25 - 0.01)))
    write_optiland(lens, tmp_path / "x.json")
    assert read_lens(tmp_path / "x.json").surfaces[0].medium.coefficients == medium.coefficients


def test_a_user_s_catalogue_comes_before_that_of_camkit() -> None:
    mine = parse_agf("NM FOO 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n", "mine")
    table = _changed(*SURFACES, 1, "material_post", value={"type": "Material", "name": "FOO"})
    lens, _ = parse_optiland(table, [mine])
    assert lens.surfaces[0].material == mine.glasses[0]
    with pytest.raises(ContractError, match="'FOO'"):
        parse_optiland(table)


@pytest.mark.parametrize("name", [n for n in built_in_lenses() if "thin" not in n])
def test_every_built_in_lens_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    lens = find_lens(name)
    path = tmp_path / "lens.json"
    write_optiland(lens, path)
    back = read_lens(path)
    assert back.surfaces == tuple(
        # a radius is written, and its inverse may be a neighbour; nothing is said of `vary`
        Surface(**{**_facts(s), "curvature_per_mm": 1 / s.radius_mm, "vary": ()})
        for s in lens.surfaces
    )
    for key in ("stop", "aperture_kind", "wavelengths_um", "reference_wavelength_um"):
        assert getattr(back, key) == getattr(lens, key)
    assert back.aperture_value == pytest.approx(lens.aperture_value, rel=1e-15)
    assert back.object_distance_mm == lens.object_distance_mm
    assert back.field_angles_rad == pytest.approx(lens.field_angles_rad, rel=1e-14)


def _facts(surface: Surface) -> dict[str, Any]:
    return {name: getattr(surface, name) for name in Surface.__dataclass_fields__}


def test_media_before_and_behind_the_lens_come_back(tmp_path: Path) -> None:
    lens = Lens(
        name="immersed",
        surfaces=(
            Surface(curvature_per_mm=0.1, thickness_mm=3.0, glass="N-BK7"),
            Surface(curvature_per_mm=0.0, thickness_mm=7.0, glass="WATER-Misc"),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=1.0,
        object_distance_mm=20.0,
        object_glass="WATER-Misc",
    )
    for suffix in (".json", ".zmx", ".toml"):
        path = tmp_path / f"lens{suffix}"
        _write(lens, path)
        back = read_lens(path)
        assert (back.object_glass, back.surfaces[-1].glass) == ("WATER-Misc", "WATER-Misc")
        assert paraxial_data(back) == paraxial_data(lens)
    assert "object_glass" in (tmp_path / "lens.toml").read_text()
    assert paraxial_data(lens) != paraxial_data(_in_air(lens))


def _write(lens: Lens, path: Path) -> None:
    from camkit.models_def.optics.lens_file.lens_file import write_lens

    write_lens(lens, path)


def _in_air(lens: Lens) -> Lens:
    from dataclasses import replace

    return replace(lens, object_glass="air")


def test_what_optiland_cannot_carry_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="has grooves"):
        optiland_table(find_lens("thin-plate-single"))


@pytest.mark.parametrize("text", ["", "{", "[]", '{"surface_group": []}', '{"a": 1}', "[" * 9999])
def test_a_damaged_file_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "lens.json"
    path.write_text(text)
    with pytest.raises(DecodeError):
        read_lens(path)


def test_replaced_values_give_a_lens_or_an_expected_error() -> None:
    def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        items = value.items() if isinstance(value, dict) else enumerate(value)
        found = [path] if path else []
        for key, inner in items:
            is_table = isinstance(inner, dict | list)
            found += leaves(inner, (*path, key)) if is_table else [(*path, key)]
        return found

    for path in leaves(_table()):
        for value in (None, "x", -1, 0, 1e300, math.inf, [], {}, True):
            try:
                parse_optiland(_changed(*path, value=value))
            except CamkitError:
                continue


def test_every_maker_s_glass_has_a_table_that_is_json() -> None:
    for catalogue in builtin_catalogues():
        glass = catalogue.glasses[0]
        json.dumps(glass_table(glass, ()))

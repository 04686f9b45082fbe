import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.models_def.optics.configuration.exact_text import degrees_text
from camkit.models_def.optics.prescription import (
    Lens,
    Surface,
    format_prescription,
    parse_prescription,
    read_prescription,
    with_focus_shift,
    write_prescription,
)
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors, perturb

GOOD = """
name = "one"
stop = 0
f_number = 4.0
object_distance_mm = inf
field_angles_deg = [0.0, 10.0]
wavelengths_um = [0.5]
[[surface]]
radius_mm = 25.0
thickness_mm = 3.0
glass = "N-BK7-Schott"
conic = -1.0
even_asphere = [0.0, 1e-6]
[[surface]]
radius_mm = inf
thickness_mm = 45.0
"""

finite = st.floats(-0.2, 0.2, allow_nan=False).filter(lambda v: v == 0 or abs(v) > 1e-4)
surfaces = st.builds(
    Surface,
    curvature_per_mm=finite,
    thickness_mm=st.floats(0, 50),
    glass=st.sampled_from(["air", "PMMA-Sultanova2009"]),
    semi_diameter_mm=st.sampled_from([math.inf, 5.5]),
    conic=st.floats(-3, 3),
    even_asphere=st.sampled_from([(), (1e-4, 2e-7)]),
)


def test_toml_is_read_in_its_units() -> None:
    lens = parse_prescription(GOOD)
    assert lens.surfaces[0].radius_mm == 25.0
    assert lens.surfaces[1].radius_mm == math.inf
    assert lens.surfaces[0].even_asphere == (0.0, 1e-6)
    assert lens.field_angles_rad[1] == pytest.approx(math.radians(10))
    assert (lens.aperture_kind, lens.aperture_value) == ("f_number", 4.0)


@given(some=st.lists(surfaces, min_size=1, max_size=4))
def test_lens_with_radii_is_written_and_read_back_to_the_last_bit(some: list[Surface]) -> None:
    lens = Lens(
        name='a "b" \\ c',
        surfaces=tuple(some),
        stop=len(some) - 1,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=3.0,
        note="two\nlines",
    )
    once = parse_prescription(format_prescription(lens))
    for before, after in zip(lens.surfaces, once.surfaces, strict=True):
        assert after.curvature_per_mm == pytest.approx(before.curvature_per_mm, rel=1e-15)
    assert parse_prescription(format_prescription(once)) == once
    assert replace(once, surfaces=lens.surfaces) == lens


def test_files_round_trip(tmp_path: Path) -> None:
    lens = parse_prescription(GOOD)
    write_prescription(lens, tmp_path / "lens.toml")
    assert read_prescription(tmp_path / "lens.toml").surfaces == lens.surfaces


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("radius_mm = 25.0", "radius = 25.0"), "surface 0: unknown key 'radius'"),
        (("radius_mm = 25.0", "radius_mm = 0"), "must not be 0"),
        (
            ("thickness_mm = 3.0", 'thickness_mm = "3"'),
            "surface 0.thickness_mm must be a number",
        ),
        (('"N-BK7-Schott"', '"BK"'), "known name"),
        (("stop = 0", "stop = 7"), "stop must be"),
        (("stop = 0", "stop = true"), "the lens.stop must be a whole number"),
        (("f_number = 4.0", "f_number = -1"), "must be > 0"),
        (("f_number = 4.0", ""), "exactly one of"),
        (("f_number = 4.0", "f_number = 4.0\nstop_semi_diameter_mm = 3.0"), "exactly one of"),
        (("[0.5]", "[500.0]"), "wavelengths"),
        (("[0.0, 10.0]", "[145.0]"), "field angles"),
        (("object_distance_mm = inf", "object_distance_mm = -5"), "object_distance_mm"),
        (
            ("even_asphere = [0.0, 1e-6]", "even_asphere = 1"),
            "surface 0.even_asphere must be a list",
        ),
        (('name = "one"', "name = 1"), "the lens.name must be a text"),
        (('name = "one"', "name = "), "is not valid TOML"),
    ],
)
def test_wrong_prescription_is_refused(change: tuple[str, str], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        parse_prescription(GOOD.replace(*change, 1))


GLASS = """
[[glass]]
name = "Q1-mine"
formula = "cauchy"
coefficients = [1.6, 0.005]
range_um = [0.4, 0.8]
source = "my own"
"""
AGF = "NM FOO 2 0 1.6 50\nCD 1.4 0.01\nLD 0.3 2\n"


def test_prescription_brings_its_own_glass_along() -> None:
    text = GOOD.replace('"N-BK7-Schott"', '"Q1-mine"') + GLASS
    lens = parse_prescription(text)
    assert lens.surfaces[0].medium.coefficients == (1.6, 0.005)
    assert parse_prescription(format_prescription(lens)) == lens
    with pytest.raises(ContractError, match="Q1-mine"):
        parse_prescription(text.split("[[glass]]")[0])


def test_glass_catalogues_lie_beside_the_prescription(tmp_path: Path) -> None:
    (tmp_path / "my.agf").write_text(AGF)
    text = 'glass_catalogues = ["my.agf"]\n' + GOOD.replace('"N-BK7-Schott"', '"FOO"')
    (tmp_path / "lens.toml").write_text(text)
    lens = read_prescription(tmp_path / "lens.toml")
    assert lens.surfaces[0].glass == "FOO-my"
    # once written, the file needs no catalogue beside it
    assert parse_prescription(format_prescription(lens)) == lens
    with pytest.raises(ContractError, match="relative to a file"):
        parse_prescription(text)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ('glass_catalogues = "my.agf"', "glass_catalogues must be a list"),
        ("glass = 3", "the lens.glass must be a list"),
        ("glass = [{name = 'x'}]", "glass 'x' lacks coefficients"),
    ],
)
def test_wrong_glass_keys_are_refused(extra: str, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        parse_prescription(f"{extra}\n{GOOD}")


def test_trade_name_becomes_the_strict_one() -> None:
    assert Surface(curvature_per_mm=0, thickness_mm=1, glass="N-BK7").glass == "N-BK7-Schott"
    assert parse_prescription(GOOD.replace("N-BK7-Schott", "N-BK7")) == parse_prescription(GOOD)


def test_material_of_another_name_is_refused() -> None:
    glass = Surface(curvature_per_mm=0, thickness_mm=1, glass="N-BK7").medium
    with pytest.raises(ContractError, match="one name"):
        Surface(curvature_per_mm=0, thickness_mm=1, glass="F2-Schott", material=glass)


@given(degrees=st.floats(0, 89.9))
def test_angles_are_written_so_that_they_come_back_to_the_last_bit(degrees: float) -> None:
    assert math.radians(float(degrees_text(math.radians(degrees)))) == math.radians(degrees)


def test_single_surface_table_is_refused() -> None:
    text = GOOD[: GOOD.rindex("[[surface]]")].replace("[[surface]]", "[surface]")
    with pytest.raises(ContractError, match="surface must be a list"):
        parse_prescription(text)


def test_lens_without_surfaces_is_refused() -> None:
    with pytest.raises(ContractError, match="at least one surface"):
        Lens(name="x", surfaces=(), stop=0, aperture_kind="f_number", aperture_value=4.0)


def test_nan_and_negative_semi_diameters_are_refused() -> None:
    with pytest.raises(ContractError, match="finite"):
        Surface(curvature_per_mm=math.nan, thickness_mm=1.0)
    with pytest.raises(ContractError, match="semi_diameter_mm"):
        Surface(curvature_per_mm=0.0, thickness_mm=1.0, semi_diameter_mm=-1.0)


def test_fabricated_copy_stays_within_its_tolerances() -> None:
    lens, errors = parse_prescription(GOOD), FabricationErrors()
    for seed in range(30):
        copy = perturb(lens, errors, np.random.default_rng(seed))
        front, back = copy.surfaces
        assert abs(front.radius_mm / 25.0 - 1) <= errors.radius_relative * (1 + 1e-12)
        assert abs(front.thickness_mm - 3.0) <= errors.thickness_mm
        assert abs(front.index_offset) <= errors.index
        assert abs(back.thickness_mm - 45.0) <= errors.focus_mm
        assert back.radius_mm == math.inf
        assert back.index_offset == 0


def test_same_seed_gives_the_same_copy() -> None:
    lens = parse_prescription(GOOD)
    first, second = (perturb(lens, FabricationErrors(), np.random.default_rng(3)) for _ in "ab")
    assert first == second


def test_fabricated_copy_is_not_written_as_a_design() -> None:
    copy = perturb(parse_prescription(GOOD), FabricationErrors(), np.random.default_rng(1))
    with pytest.raises(ContractError, match="nominal"):
        format_prescription(copy)


def test_focus_shift_moves_the_sensor_away() -> None:
    lens = parse_prescription(GOOD)
    assert with_focus_shift(lens, 0.5).surfaces[-1].thickness_mm == 45.5
    assert replace(lens) == lens

import math
from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.tolerance.error_table import (
    in_file_units,
    parse_tolerances,
    read_tolerances,
)


def test_table_is_read_in_the_units_of_its_keys(tmp_path: Path) -> None:
    path = tmp_path / "errors.toml"
    path.write_text(
        """
[tolerance]
distribution = "normal"
compensator = "spot"
radius_percent = 0.1
element_tilt_arcmin = 3
surface_tilt_deg = { half_width = 0.5, distribution = "uniform" }
"""
    )
    found = read_tolerances(path)
    assert found is not None
    assert found.active() == ("radius", "surface_tilt", "element_tilt")
    assert found.radius.half_width == pytest.approx(0.001)
    assert found.radius.distribution == "normal"
    assert found.element_tilt.half_width == pytest.approx(math.radians(0.05))
    assert found.surface_tilt.half_width == pytest.approx(math.radians(0.5))
    assert found.surface_tilt.distribution == "uniform"
    assert found.compensator == "spot"


def test_file_without_the_table_has_none(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("name = 'x'")
    assert read_tolerances(tmp_path / "x.toml") is None


@pytest.mark.parametrize(
    ("table", "word"),
    [
        (3, "table"),
        ({"radius": 0.1}, "radius_percent"),
        ({"index": "much"}, "index"),
        ({"index": True}, "index"),
        ({"index": {"half": 1}}, "index"),
        ({"index": {"distribution": "normal"}}, "index"),
        ({"index": -0.1}, "index must be finite and >= 0; got -0.1"),
        ({"index": 1.0, "distribution": "flat"}, "distribution"),
        ({"surface_tilt_deg": 1.0, "surface_tilt_arcmin": 1.0}, "again"),
        ({"compensator": 7}, "compensator"),
        ({"compensator": "gap", "compensator_gap": 1.0}, "compensator_gap must be the number"),
        ({"compensator_gap": 2}, "compensator_gap needs the compensator gap"),
        ({"wedge_deg": 1.0, "wedge_arcmin": 1.0}, "again"),
        ({"power_fringes": 1000}, "100 fringes"),
    ],
)
def test_wrong_table_is_refused_with_the_key(table: object, word: str) -> None:
    with pytest.raises(ContractError, match=word):
        parse_tolerances(table)


def test_damaged_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text("[tolerance")
    with pytest.raises(ContractError, match="TOML"):
        read_tolerances(tmp_path / "x.toml")


def test_people_see_the_units_of_the_file() -> None:
    assert in_file_units("radius", 0.002) == "0.2 %"
    assert in_file_units("groove_depth", 0.01) == "1 %"
    assert parse_tolerances({"groove_depth_percent": 1.0}).groove_depth.half_width == 0.01
    assert in_file_units("element_tilt", math.radians(-1 / 60)) == "-1'"
    assert in_file_units("index", 0.0005) == "0.0005"
    assert in_file_units("wedge", math.radians(1 / 60)) == "1'"
    assert in_file_units("irregularity", -0.5) == "-0.5 fringes"
    assert [in_file_units("power", v) for v in (1.0, -1.0, 3.0)] == [
        "1 fringe",
        "-1 fringe",
        "3 fringes",
    ]


def test_figure_wedge_and_gap_are_read() -> None:
    found = parse_tolerances(
        {
            "power_fringes": 3,
            "irregularity_fringes": 0.5,
            "wedge_arcmin": 2,
            "compensator": "gap",
            "compensator_gap": 4,
        }
    )
    assert found.active() == ("power", "irregularity", "wedge")
    assert (found.power.half_width, found.irregularity.half_width) == (3, 0.5)
    assert found.wedge.half_width == pytest.approx(math.radians(2 / 60))
    assert (found.compensator, found.compensator_gap) == ("gap", 4)

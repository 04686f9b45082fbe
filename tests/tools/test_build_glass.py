"""tools/build_glass.py on a small copy of the database: what it writes is read back as glass."""

import json
from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.glass.catalogue import builtin_catalogues, find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.glass.material import Glass
from tests.tiny_design import run_tool
from tools import build_glass

NBK7 = """
DATA:
  - type: formula 2
    wavelength_range: 0.3 2.5
    coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653
SPECS:
  nd: 1.51680
  Vd: 64.17
"""
WITHOUT_SPECS = """
DATA:
  - type: formula {formula}
    wavelength_range: 0.4 1.1
    coefficients: {numbers}
"""


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    monkeypatch.setattr(build_glass, "DATA", folder)
    return folder


def written(path: Path) -> dict[str, list[object]]:
    table = json.loads(path.read_text(encoding="utf-8"))
    return {row[0]: row[1:] for row in table["glasses"]}


def test_a_maker_s_file_becomes_the_glass_that_camkit_has(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    glasses = tmp_path / "database" / "glass" / "schott"
    glasses.mkdir(parents=True)
    (glasses / "N-BK7.yml").write_text(NBK7, encoding="utf-8")
    (glasses / "TABLE.yml").write_text("DATA:\n  - type: tabulated n\n", encoding="utf-8")
    paper = tmp_path / "database" / "main"
    paper.mkdir()
    numbers = "2.0 0.01 2 0.02 -2"
    text = WITHOUT_SPECS.format(formula=3, numbers=numbers)
    (paper / "X.yml").write_text(text, encoding="utf-8")
    monkeypatch.setattr(build_glass, "MAKERS", {"Schott": "a source"})
    monkeypatch.setattr(build_glass, "LITERATURE", {"X-Paper": ("main/X", "a paper")})
    run_tool(monkeypatch, "build_glass", tmp_path / "database")
    name, formula, range_um, index_d, abbe_number, coefficients = (
        "N-BK7",
        *written(data / "schott.json")["N-BK7"],
    )
    glass = find_glass("N-BK7-Schott")
    assert (name, formula, tuple(coefficients)) == ("N-BK7", glass.formula, glass.coefficients)
    assert (index_d, abbe_number) == (glass.stated_index_d, glass.stated_abbe_number)
    assert tuple(range_um) == glass.range_um
    assert [*written(data / "literature.json")] == ["X-Paper"]


@pytest.mark.parametrize(
    ("formula", "numbers", "expected"),
    [
        (1, "0.5 1.0 0.1", ("sellmeier_offset", [0.5, 1.0, 0.1**2])),
        (3, "2.2 -0.01 2 0.01 -2", ("schott", [2.2, -0.01, 0.01, 0.0, 0.0, 0.0])),
        (3, "2.2 0.5 1", ("powers", [2.2, 0.0, 0.5, 1.0])),
        (5, "1.5 0.004 -2", ("cauchy", [1.5, 0.004])),
        (5, "1.5 0.004 -4", None),
        (4, "1 2 3", None),
    ],
)
def test_formulas_are_told_in_camkit_s_terms(
    formula: int, numbers: str, expected: tuple[str, list[float]] | None
) -> None:
    text = WITHOUT_SPECS.format(formula=formula, numbers=numbers)
    assert build_glass.dispersion(text) == expected


def test_an_old_glass_is_taken_where_another_one_bears_it_out(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """BK7 is today's N-BK7; a row that no glass resembles is left out, and so it is said."""
    (kept,) = [c for c in builtin_catalogues() if c.name == "Schott1983"]
    two = next(g for g in kept.glasses if g.formula == "buchdahl")
    name = two.name.removesuffix("-Schott1983")
    numbers = " ".join(f"{v:.10g}" for v in two.coefficients[:3])
    lines = ["# name N0 v1 v2", f"{name} {numbers}", "ODD1 1.9 -0.9 0.4", "#---", "rest 1 2 3"]
    table = tmp_path / "table.txt"
    table.write_text("\n".join(lines), encoding="utf-8")
    run_tool(monkeypatch, "build_glass", "--classic", table)
    assert "ODD1: not borne out, left out" in capsys.readouterr().out
    rows = written(data / "schott1983.json")
    formula, range_um, _, _, coefficients = rows[name]
    found = Glass(
        name=name, formula=formula, coefficients=tuple(coefficients), source="", range_um=range_um
    )
    waves = torch.linspace(0.45, 0.65, 5, dtype=torch.float64)
    assert torch.equal(refractive_index(found, waves), refractive_index(two, waves))
    assert "ODD1" not in rows
    assert "rest" not in rows


def test_an_old_glass_is_taken_where_another_maker_s_row_of_the_table_bears_it_out(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = ["# name N0 v1 v2", "ODD1 1.9 -0.9 0.4", "ODD2 1.8 -0.9 0.4", "#---", "# another"]
    table = tmp_path / "table.txt"
    table.write_text("\n".join([*lines, "LIKE1 1.9003 -0.90001 0.4"]), encoding="utf-8")
    run_tool(monkeypatch, "build_glass", "--classic", table)
    rows = written(data / "schott1983.json")
    assert "ODD1" in rows
    assert "ODD2" not in rows


def test_glasses_that_schott_marks_obsolete_are_taken_by_its_coefficients(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither those of today, nor clearer melts, nor what camkit has already."""
    file = tmp_path / "SCHOTT.AGF"
    glasses = [
        ("OLD1", "1.6 50 0 2"),
        ("OLD1HT", "1.6 50 0 2"),
        ("NEW1", "1.6 50 0 1"),
        ("N-BK7", "1.6 50 0 2"),
        ("BK7", "1.6 50 0 2"),
    ]
    lines = (f"NM {name} 2 0 {rest}\nCD 1.4 0.01\nLD 0.3 2\n" for name, rest in glasses)
    file.write_text("".join(lines), encoding="utf-8")
    run_tool(monkeypatch, "build_glass", "--obsolete", file)
    rows = written(data / "schottobsolete.json")
    assert rows == {"OLD1": ["sellmeier", [0.3, 2.0], 1.6, 50.0, [1.4, 0.01]]}

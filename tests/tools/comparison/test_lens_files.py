"""The table of lens files: what is read, what is refused, what another program has."""

import json
import sys
from pathlib import Path

import pytest

from camkit.models_def.optics.lens_file.lens_file import find_lens, write_lens
from tests.tiny_design import run_tool
from tests.zmx_factory import LA1131
from tools.comparison.lens_files import beside_optiland, measure_file, optiland_facts, row_text


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "lenses"
    place.mkdir()
    (place / "a.zmx").write_text(LA1131, encoding="latin-1")
    (place / "b.zmx").write_text(LA1131.replace("GLAS N-BK7", "GLAS MIRROR"), encoding="latin-1")
    write_lens(find_lens("duet"), place / "c.json")
    (place / "notes.txt").write_text("no lens")
    return place


def test_the_table_counts_what_is_read_and_what_is_refused(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run_tool(monkeypatch, "comparison.lens_files", folder, "--json", tmp_path / "out.json")
    first, *rows, counts = capsys.readouterr().out.splitlines()
    assert first.startswith("without --optiland")
    assert len(rows) == 3
    # the singlet of the vendor: f = 50 mm at 587.6 nm, 44.2 mm from its back
    assert rows[0].startswith("lenses/a.zmx: read; EFL 49.8")
    assert rows[1] == (
        "lenses/b.zmx: UnsupportedError: b.zmx: line 32: surface 1 is a mirror; "
        "camkit traces lenses only"
    )
    assert counts == "read: 2, UnsupportedError: 1"
    table = json.loads((tmp_path / "out.json").read_text())
    assert [row["state"] for row in table] == ["read", "UnsupportedError", "read"]


def test_an_interpreter_without_optiland_costs_its_numbers_and_nothing_else(folder: Path) -> None:
    path = folder / "a.zmx"
    facts, lens = measure_file(path)
    assert lens is not None
    others = beside_optiland([(path, lens)], Path(sys.executable))
    assert set(others[path]) == {"zmx", "json", "own"}
    assert "optiland could not be started" in row_text(facts, others[path])
    assert optiland_facts([], Path(sys.executable)) == []


def test_numbers_of_another_program_stand_beside_camkit_s(folder: Path) -> None:
    facts, _ = measure_file(folder / "c.json")
    text = row_text(
        facts, {"json": {"efl_mm": 50.25, "spot_um": 1.5, "rays": 127, "chief_mm": 9.5}}
    )
    assert text.endswith("; json: EFL 50.25, spot 1.5 um, chief 9.5 mm")

"""`camkit plate show` from a file to a page and one JSON object."""

import json
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode

PLATE = """
name = "line"
glass = "SILICA"
cells = 128

[bench]
diameter_mm = 1.5
focal_length_mm = 25.0
focus_mm = 2000.0

[etching]
range_um = 0.2
levels = 8

[pattern]
kind = "star"
angles_deg = [90]
near_um = 40.0
far_um = 150.0
share = 0.1
"""


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    path = tmp_path / "line.toml"
    path.write_text(PLATE, encoding="utf-8")
    return path


def test_json_is_one_object_and_nothing_is_written(
    plate: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(plate.parent)
    assert run(["plate", "show", str(plate), "--side-px", "81", "--json"]) == ExitCode.DONE
    told = json.loads(capsys.readouterr().out)
    assert [round(one["angle_deg"]) for one in told["streaks"]] == [90]
    assert set(told["core_share"]) == {"R", "G", "B"}
    assert 0.8 < told["strehl"] < told["bare"]["strehl"]
    assert told["core_share"]["G"] < told["bare"]["core_share"]["G"]
    assert [path.name for path in plate.parent.iterdir()] == ["line.toml"]


def test_the_page_is_written_where_it_is_wanted_and_not_replaced_unasked(
    plate: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["plate", "show", str(plate), "--side-px", "41", "-o", str(tmp_path / "page")]
    assert run([*words, "--depth-m", "inf"]) == ExitCode.DONE
    assert str(tmp_path / "page" / "line.html") in capsys.readouterr().out
    before = (tmp_path / "page" / "line.html").read_bytes()
    assert run(words) == ExitCode.USAGE
    assert "--overwrite" in capsys.readouterr().err
    assert (tmp_path / "page" / "line.html").read_bytes() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--depth-m", "0"], "--depth-m must be > 0"),
        (["--depth-m", "nan"], "--depth-m must be > 0"),
        (["--side-px", "40"], "side_px must be odd"),
        (["--side-px", "401"], "side_px is 1"),
        (["--recipe", "none.toml"], "none.toml"),
    ],
)
def test_what_cannot_be_is_one_line(
    plate: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(plate.parent.rglob("*"))
    assert run(["plate", "show", str(plate), "-o", str(plate.parent / "page"), *words]) != 0
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert message in told[0]
    assert sorted(plate.parent.rglob("*")) == before


def test_a_wrong_name_is_told_the_plates_that_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["plate", "show", "streak-9", "--json"]) != ExitCode.DONE
    assert "name a file, or one of" in capsys.readouterr().err

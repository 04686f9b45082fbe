"""Captures hold the lights that they are named for; seconds are told by stage beside the goals."""

import json
from pathlib import Path
from typing import Any

import pytest

from camkit.bundle.reader import Bundle
from camkit.runtime.raw import read_capture
from tests.hdr_bundle import write_hdr_bundle
from tests.tiny_design import run_tool
from tools import stage_profile
from tools.hdr import speed, speed_captures
from tools.hdr.speed_captures import Subject, write_subject


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bundle:
    monkeypatch.setattr(speed_captures, "GRID", 3)
    monkeypatch.setattr(speed_captures, "LAMP_RADIUS_PX", 4.0)
    return write_hdr_bundle(tmp_path)


@pytest.mark.parametrize(
    ("subject", "least", "most"),
    [
        (Subject(name="nothing"), 0.0, 0.0),
        (Subject(name="lamps", lamps=9), 9 * 30 / 48384, 9 * 90 / 48384),
        (Subject(name="3 %", share=0.03), 0.015, 0.04),
    ],
)
def test_a_capture_of_the_whole_sensor_clips_what_it_is_named_for(
    subject: Subject, least: float, most: float, bundle: Bundle, tmp_path: Path
) -> None:
    path = tmp_path / "subject.dng"
    found = write_subject(path, subject, bundle)
    capture = read_capture(path)
    assert (capture.width, capture.height) == (252, 192)
    assert capture.saturated_rows(0, 192).mean() == pytest.approx(found)
    assert least <= found <= most


def test_scenes_stand_once_in_every_row_and_column(bundle: Bundle, tmp_path: Path) -> None:
    path = tmp_path / "subject.dng"
    write_subject(path, Subject(name="1 %", share=0.01), bundle)
    samples = read_capture(path).samples
    tiles = [
        [samples[64 * y : 64 * y + 64, 84 * x : 84 * x + 84].tobytes() for x in range(3)]
        for y in range(3)
    ]
    assert len({tile for row in tiles for tile in row}) == 3
    assert all(len(set(line)) == 3 for line in (*tiles, *zip(*tiles, strict=True)))


def _in_process(arguments: Any) -> str:
    return json.dumps(stage_profile._profile_once(arguments))


def test_seconds_are_told_beside_the_goals_and_drawn(
    bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.setattr(speed, "run_again", _in_process)
    monkeypatch.setattr(stage_profile, "WATCH_S", 0.001)
    subjects = (Subject(name="nothing"), Subject(name="1.5 %", share=0.015))
    monkeypatch.setattr(speed, "SUBJECTS", subjects)
    out = tmp_path / "speed.json"
    run_tool(monkeypatch, "hdr.speed", "--bundle", bundle.path, "--runs", 1, "-o", out)
    rows = json.loads(out.read_text())["rows"]
    assert [(row["subject"], row["method"]) for row in rows] == [
        *(("nothing", "develop"), ("nothing", "physics")),
        *(("1.5 %", "develop"), ("1.5 %", "physics")),
    ]
    developed, restored = rows[2:]
    assert "highlights" not in developed["stages_cpu_s"]
    assert restored["stages_cpu_s"]["highlights"] > 0
    assert restored["cpu_s"] == pytest.approx(sum(restored["stages_cpu_s"].values()), abs=0.01)
    assert restored["over_development_s"] == pytest.approx(
        restored["cpu_s"] - developed["cpu_s"], abs=0.002
    )
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    said = capsys.readouterr().out
    assert "of 30 kept" in said
    assert said.count("of 1.5 kept") == 1


def test_a_goal_that_is_missed_is_told() -> None:
    row = {
        "subject": "512 px, 1.5 %",
        "share": 0.015,
        "method": "physics",
        "cpu_s": 2.0,
        "over_development_s": 1.0,
        "peak_mb": 1500.0,
        "stages_cpu_s": {"highlights": 1.0},
    }
    told = speed.to_text([row])
    assert "2.0 of 0.8 missed" in told
    assert "1500 missed" in told

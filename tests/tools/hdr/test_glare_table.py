"""The table of glare: what it prints is measured, streaks that do not fade included."""

import json
import sys
from pathlib import Path

import pytest

from tools.hdr import glare_table


def test_scenes_gain_and_clean_ones_stay(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "deglare.json"
    words = ["glare_table", "--seeds", "7", "--clean-seeds", "26", "-o", str(out)]
    monkeypatch.setattr(glare_table, "SIDES_PX", (288, 384))
    monkeypatch.setattr(sys, "argv", words)
    glare_table.main()
    record = json.loads(out.read_text(encoding="utf-8"))
    (row,), (clean,) = record["streaks"], record["clean"]
    assert row["fading"] == "even"
    assert clean["to_itself_db"] is None
    assert abs(row["found_deg"] - row["angle_deg"]) < 0.1
    assert row["after_db"] > row["before_db"] + 3
    assert f"mean {row['before_db']:.1f} -> {row['after_db']:.1f} dB" in capsys.readouterr().out

"""The table of glare: what it prints is measured, streaks that do not fade included."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
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


def test_pictures_are_measured_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scene, photo = tmp_path / "scene.hdr", tmp_path / "photo.png"
    light = np.random.default_rng(0).random((60, 1100, 3), np.float32) ** 8 * 50
    cv2.imwrite(str(scene), light)
    cv2.imwrite(str(photo), np.full((20, 30, 3), 90, np.uint8))
    words = ["glare_table", "--seeds", "7", "--clean-seeds", "--pictures", str(scene), str(photo)]
    monkeypatch.setattr(glare_table, "SIDES_PX", (60, 80))
    monkeypatch.setattr(sys, "argv", words)
    glare_table.main()
    said = capsys.readouterr().out
    assert "| scene.hdr | exponential | 5.0 |" in said
    assert "| photo.png" not in said
    assert "changed without streaks: []" in said
    assert glare_table.picture(scene).shape == (3, 30, 550)

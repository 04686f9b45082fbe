"""Lamps behind a windshield: read from its streaks where their angle is found."""

import json
import sys
from pathlib import Path

import pytest

from tools.hdr import glare_lights


def test_lamps_gain_where_the_angle_is_found(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "found.json"
    monkeypatch.setattr(sys, "argv", ["glare_lights", "--seeds", "1", "-o", str(out)])
    glare_lights.main()
    record = json.loads(out.read_text(encoding="utf-8"))
    scores = record["scenes"]["night:1"]["scores"]
    assert abs(record["scenes"]["night:1"]["found_deg"] + 5) < 0.1
    assert scores["both"]["hdr_psnr_db"] > scores["capture"]["hdr_psnr_db"] + 3
    assert scores["both"]["stops_rmse"] < scores["capture"]["stops_rmse"] - 1
    assert scores["both"]["unclipped_psnr_db"] > scores["capture"]["unclipped_psnr_db"] + 5
    assert scores["share doubled"]["stops_rmse"] > scores["angle found"]["stops_rmse"]
    assert record["means"]["both"]["scenes"] == 1
    assert "| both | 1 |" in capsys.readouterr().out


def test_no_angle_gives_no_means(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["glare_lights", "--seeds", "3"])
    monkeypatch.setattr(glare_lights, "SIDES_PX", (96, 128))
    glare_lights.main()
    scene = glare_lights.measured(3)
    assert capsys.readouterr().out.count("\n") == 2
    assert scene["found_deg"] is None
    assert list(scene["scores"]) == ["capture", "deglared", "all known"]

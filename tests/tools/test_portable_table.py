"""The measurement of portable cameras, on small captures."""

import json
from pathlib import Path

import pytest

from camkit.bundle.reader import built_in_bundles
from tests.tiny_design import run_tool
from tools import portable_table


def test_a_camera_is_measured_beside_camkit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(portable_table, "SIDES_PX", (120, 180))
    monkeypatch.setattr(portable_table, "CALLS", 1)
    out = tmp_path / "table.json"
    run_tool(monkeypatch, "portable_table", built_in_bundles()["duet"], "-o", out)
    (camera,) = json.loads(out.read_text())["cameras"]
    assert camera["agrees"] == {"lights": True, "places": True}
    rows = {(row["case"], row["size"]): row for row in camera["golden"]}
    assert len(rows) == 6
    assert all(row["is_met"] for row in rows.values())
    assert rows["very_dark", "S"]["before_undistortion_db"] > 150
    assert rows["very_dark", "S"]["brightest"] < 0.1
    assert rows["very_dark", "S"]["end_db_of_brightest"] > 100
    assert {"block", "tile_S", "tile_M", "warp"} <= camera["graph_ms"].keys()
    assert [frame["size"] for frame in camera["frames"]] == ["S", "M"]
    assert all(frame["ratio"] > 0 for frame in camera["frames"])


def test_pictures_of_photons_are_compared_beside_their_brightest_value(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "table.json"
    bundle = built_in_bundles()["spad-sr"]
    run_tool(monkeypatch, "portable_table", bundle, "--repeat", "0", "-o", out)
    (camera,) = json.loads(out.read_text())["cameras"]
    assert [row["case"] for row in camera["golden"]] == 2 * ["dim", "typical", "bright"]
    assert all(row["is_met"] for row in camera["golden"])
    assert min(row["end_db_of_brightest"] for row in camera["golden"]) > 130

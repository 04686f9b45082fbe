"""tools/render_chart.py on one window and a few rays."""

import json
from pathlib import Path

import pytest

from tests.tiny_design import run_tool
from tools import render_chart
from tools.render_chart import Choice


def test_rays_and_maps_are_held_against_one_reference(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render_chart, "HEIGHTS_MM", (5.0,))
    monkeypatch.setattr(render_chart, "RAYS", ((4, 1),))
    monkeypatch.setattr(render_chart, "MAPS", (Choice(fields=2), Choice(waves=1)))
    monkeypatch.setattr(render_chart, "DEPTHS", (2,))
    monkeypatch.setattr(render_chart, "MAP_RAYS", 64)
    monkeypatch.setattr(render_chart, "KERNEL_PX", 33)
    size = ("--side-px", 4, "--reference-spp", 128)
    run_tool(monkeypatch, "render_chart", "--out-dir", tmp_path, *size)
    table = json.loads((tmp_path / "render.json").read_text(encoding="utf-8"))
    assert table["pixels"] == 16
    assert [row["method"] for row in table["rows"]] == ["rays", *["map"] * 5]
    assert all(0 <= row["error"] < 1 for row in table["rows"])
    assert (tmp_path / "render.png").read_bytes().startswith(b"\x89PNG")

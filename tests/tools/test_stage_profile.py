"""tools/stage_profile.py on tiny captures: each of its profiles."""

from pathlib import Path

import pytest

from camkit.kinds import BAYER
from tests.bundle_factory import write_tiny_bundle
from tests.capture_factory import write_tiny_captures
from tests.tiny_design import run_tool
from tools import stage_profile


def rows(printed: str) -> list[list[str]]:
    """Give the cells of all Markdown tables without their rules."""
    lines = [line for line in printed.splitlines() if line.startswith("|") and "---" not in line]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_stages_are_told_by_wall_and_processor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    monkeypatch.setattr(stage_profile, "WATCH_S", 0.001)
    command = ("stages", tmp_path / "a.dng", "--bundle", bundle, "--threads", 1)
    run_tool(monkeypatch, "stage_profile", *command, "--runs", 0)
    once = capsys.readouterr().out
    monkeypatch.setattr(stage_profile, "run_again", lambda _: once)
    run_tool(monkeypatch, "stage_profile", *command, "--runs", 2)
    table = {row[0]: row[1:] for row in rows(capsys.readouterr().out)}
    assert list(table)[:12] == ["stage", "decode", *BAYER.stages]
    assert {"write", "hash", "sync", "all", "peak MB"} <= set(table)
    assert float(table["all"][0]) > float(table["network"][0]) >= 0
    assert "main" in table


def test_layers_are_told_with_their_multiplications(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_bundle(tmp_path)
    monkeypatch.setattr(stage_profile, "SIDE_PX", 64)
    monkeypatch.setattr(stage_profile, "gemm_peak_gmac_per_s", lambda _: 100.0)
    run_tool(monkeypatch, "stage_profile", "layers", "--bundle", bundle, "--threads", 1)
    said = capsys.readouterr().out
    assert "64x64, 1 thread(s); matrix product 100 GMAC/s" in said
    head, *nodes, everything = rows(said)
    assert head[:3] == ["node", "kind", "ms"]
    assert sum(float(row[2]) for row in nodes) == pytest.approx(float(everything[2]), abs=1)
    assert sum(bool(row[4]) for row in nodes) == 3

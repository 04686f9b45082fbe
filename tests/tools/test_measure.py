"""tools/measure.py on tiny captures: each of its tables."""

from pathlib import Path

import pytest

from camkit.runtime.network.openvino_session import missing_bfloat16
from tests.bundle_factory import write_tiny_bundle
from tests.capture_factory import write_tiny_captures
from tests.tiny_design import run_tool


def rows(printed: str) -> list[list[str]]:
    """Give the cells of a Markdown table."""
    lines = [line for line in printed.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@pytest.mark.usefixtures("camkit_in_process")
def test_speed_gives_a_row_of_seconds_for_every_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    size = ("--bundle", bundle, "--runs", 1, "--sizes", "M")
    run_tool(monkeypatch, "measure", "speed", tmp_path / "a.dng", *size)
    said = capsys.readouterr().out
    assert said.startswith("Machine: ")
    head, _, row = rows(said)
    assert (head[0], head[-1], row[0]) == ("size", "peak MB", "M")
    assert {"decode", "wiener", "network", "write"} <= set(head)
    assert len(row) == len(head)
    assert float(row[-1]) > 10


def test_tiling_differs_from_the_whole_by_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_bundle(tmp_path)
    size = ("--width", 320, "--height", 240)
    run_tool(monkeypatch, "measure", "tiling", "--bundle", bundle, *size)
    _, _, row = rows(capsys.readouterr().out)
    assert row[1:] == ["M", "320x240", "1", "0"]


@pytest.mark.usefixtures("camkit_in_process")
def test_every_raw_file_is_developed_or_refused_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    raws = tmp_path / "raws"
    raws.mkdir()
    write_tiny_captures(tmp_path, ["a"])
    (tmp_path / "a.dng").rename(raws / "a.dng")
    (raws / "broken.dng").write_bytes(b"II*\0" + bytes(60))
    run_tool(monkeypatch, "measure", "raws", raws, "--out-dir", tmp_path / "out")
    _, _, good, broken = rows(capsys.readouterr().out)
    assert good[:6] == ["a.dng", "ok", "96x64", "RGGB", "64", "1023"]
    assert (tmp_path / "out" / "a.png").is_file()
    assert broken[:2] == ["broken.dng", "refused"]
    assert broken[-1]


def test_precision_gives_a_row_for_every_way_or_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_bundle(tmp_path)
    words = ("precision", "--bundle", str(bundle), "--sizes", "M", "--runs", "1")
    words = (*words, "--width", "96", "--height", "64")
    if (missing := missing_bfloat16()) is not None:
        with pytest.raises(SystemExit, match="bfloat16 needs"):
            run_tool(monkeypatch, "measure", *words)
        pytest.skip(f"bfloat16 needs {missing}")
    run_tool(monkeypatch, "measure", *words)
    _, _, *ways = rows(capsys.readouterr().out)
    assert [way[1] for way in ways] == ["cpu fp32", "openvino fp32", "openvino bf16"]
    assert [float(way[3]) > 0 for way in ways] == [True] * 3

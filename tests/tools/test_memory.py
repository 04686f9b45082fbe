"""Peaks of small captures against the cap, alone and two at a time."""

import sys
from pathlib import Path

import pytest

from tests.bundle_factory import write_tiny_bundle
from tools import memory


def test_peaks_are_told_as_shares_of_the_cap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_tiny_bundle(tmp_path)
    monkeypatch.setattr(memory, "CELL_PX", (32, 48))
    words = ["--bundles", str(bundle), "--sizes", "M,XL", "--megapixels", "0.006,0.024"]
    monkeypatch.setattr(sys, "argv", ["memory", *words, "--max-mem", "1G", "--jobs", "1,2"])
    memory.main()
    *rows, last = capsys.readouterr().out.splitlines()
    assert last.startswith("4 runs, 0 above the cap")
    shares = [float(row.split("|")[-2]) for row in rows[2:]]
    assert all(0.02 < share < 1 for share in shares)
    assert all(float(row.split("|")[6]) > 0.1 for row in rows[2:])


def test_a_run_that_fails_ends_the_measurement(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "CELL_PX", (32, 48))
    captures = memory.Captures(tmp_path, str(write_tiny_bundle(tmp_path)), 0.006)
    with pytest.raises(SystemExit, match="asked for XXL"):
        captures.peak_mb(["--size", "XXL"], files=1)

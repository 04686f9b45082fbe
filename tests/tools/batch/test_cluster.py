"""One process and a cluster take turns; bits are compared, a killed worker costs nothing."""

import json
import sys
from pathlib import Path

import pytest

from tests.bundle_factory import write_tiny_bundle
from tools.batch import cluster


def test_both_ways_are_measured_and_give_equal_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle, found = write_tiny_bundle(tmp_path), tmp_path / "found.json"
    command = ["cluster", "--bundle", bundle, "--captures", 5, "--width", 96, "--height", 64]
    command += ["--workers", 1, "--rounds", 1, "--kill", 3, "-o", found]
    monkeypatch.setattr(sys, "argv", [str(word) for word in command])
    cluster.main()
    told = capsys.readouterr().out
    assert [line.split("|")[2].strip() for line in told.splitlines() if "| 1 |" in line] == [
        "jobs",
        "cluster",
    ]
    record = json.loads(found.read_text())
    assert record["equal_bits"]
    assert record["kills"] == 1
    assert record["bytes_in"] > 1000
    assert record["caller_cpu_ms_a_file"] > 0
    assert record["seconds_with_kills"] > 0

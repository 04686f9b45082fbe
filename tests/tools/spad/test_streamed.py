"""A cube is drawn, made into depth by a process, and its memory told."""

import json
from pathlib import Path

import pytest

from tools.spad import streamed


def test_seconds_and_memory_are_told(tmp_path: Path) -> None:
    out = tmp_path / "found" / "streamed.json"
    streamed.main(["--side", "24", "--bins", "96", "-o", str(out)])
    first, last = json.loads(out.read_text(encoding="utf-8"))["rows"]
    assert first["layout"] != last["layout"]
    for row in (first, last):
        assert row["median_error_ps"] == pytest.approx(2.0, abs=0.5)
        assert row["valid"] > 0.99
        assert 50 < row["peak_rss_mb"] < 1000


def test_a_process_that_fails_says_why(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="memory cap must be at least"):
        streamed.main(["--side", "8", "--bins", "96", "--max-mem", "1M", "-o", str(tmp_path / "a")])

"""The web service of the examples, started and used: nothing is lost, whatever is sent."""

import json
from pathlib import Path

import pytest

from tools import embedding_load

pytest.importorskip("fastapi", reason="fastapi is not installed")
pytest.importorskip("uvicorn", reason="uvicorn is not installed")


def test_every_request_gets_its_answer_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(embedding_load, "SMALL_PX", (96, 64))
    monkeypatch.setattr(embedding_load, "LARGE_PX", (160, 128))
    out = tmp_path / "load.json"
    embedding_load.main(["--requests", "4", "--at-once", "4", "-o", str(out)])
    record = json.loads(out.read_text())
    assert (record["wrong"], record["files_left"]) == ([], [])
    assert sum(answer["count"] for answer in record["answers"]) == 6  # and two behind them
    assert "cut off" in record["reasons"]["half a file"]
    assert record["workers_at_the_end"] == 2

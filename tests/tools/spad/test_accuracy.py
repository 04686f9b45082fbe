"""Accuracy is judged against what was aimed at, and charted."""

import json
from pathlib import Path

import pytest

from camkit.report.kinds.spad import timing
from tools.spad import accuracy


def test_a_small_run_has_a_row_for_every_method(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timing, "FITTED", 5)
    monkeypatch.setattr(timing, "SHAPE", (8, 64))
    monkeypatch.setattr(accuracy, "BACKGROUNDS", (0.1,))
    arguments = ["--out-dir", str(tmp_path), "--photons", "100", "1000", "--sbr", "inf", "1"]
    arguments += ["--pixels", "512", "--turns", "1", "--alarm-pixels", "512"]
    assert accuracy.main(arguments) == 0
    record = json.loads((tmp_path / "depth-accuracy.json").read_text(encoding="utf-8"))
    assert len(record["rows"]) == 4 * len(accuracy.METHODS)
    log = [row for row in record["rows"] if row["method"] == "log"]
    assert all(0.85 < row["rmse_over_crb"] < 1.2 for row in log)
    assert [row["false_alarms"] is None for row in log] == [True, True, False, False]
    aims = {aim["what"]: aim for aim in record["aims"]}
    assert aims["times faster than curve_fit, median"]["least"] == 300
    assert aims["below least squares without background, least"]["met"]
    assert (tmp_path / "depth-accuracy.png").is_file()

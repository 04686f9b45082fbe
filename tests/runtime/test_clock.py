"""Seconds of nested stages are charged once, to the innermost."""

import time

import numpy as np
import pytest

from camkit.runtime.clock import StageClock, TimedRows
from camkit.runtime.rows import ArrayRows


def test_time_inside_an_inner_stage_is_not_charged_to_the_outer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    clock = StageClock()
    with clock.stage("outer"):
        now[0] += 1.0
        with clock.stage("inner"):
            now[0] += 10.0
        now[0] += 2.0
    now[0] += 100.0
    with clock.stage("inner"):
        now[0] += 5.0
    assert clock.seconds == {"outer": 3.0, "inner": 15.0}


def test_bands_and_rows_pass_unchanged() -> None:
    clock = StageClock()
    planes = np.arange(12, dtype=np.float32).reshape(1, 4, 3)
    rows = TimedRows(ArrayRows(planes), clock, "read")
    np.testing.assert_array_equal(rows.read(1, 3), planes[:, 1:3])
    passed = list(clock.bands("made", iter([planes[:, :2], planes[:, 2:]])))
    np.testing.assert_array_equal(np.concatenate(passed, axis=1), planes)
    assert set(clock.seconds) == {"read", "made"}
    assert rows.shape == (1, 4, 3)


def test_cpu_seconds_are_charged_like_wall_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "process_time", lambda: now[0])
    clock = StageClock()
    assert clock.running is None
    with clock.stage("outer"):
        now[0] += 1.0
        with clock.stage("inner"):
            assert clock.running == "inner"
            now[0] += 10.0
    now[0] += 100.0
    assert clock.cpu_seconds == {"outer": 1.0, "inner": 10.0}

"""The simulated queue against closed forms: cores, storage, scheduler, deaths."""

import json
import math
import sys
from pathlib import Path

import pytest

from tools.batch import archive
from tools.batch.archive import Load, Simulation

QUIET = Load(
    cores=50,
    seconds=10.0,
    spread=0.0,
    stragglers=0.0,
    bytes_in=1.0,
    bytes_out=1.0,
    queue_s=0.0,
    deaths=0.0,
)


def _with(**changes: float) -> Load:
    fields = {name: getattr(QUIET, name) for name in Load.__dataclass_fields__}
    return Load(**(fields | changes))  # type: ignore[arg-type]


def test_with_enough_of_all_else_cores_are_the_limit() -> None:
    found = Simulation(_with(spread=0.3), 1).run(20_000, 1_000_000)
    mean_s = 10 * math.exp(0.3**2 / 2)
    assert found.files_a_s == pytest.approx(50 / mean_s, rel=0.02)
    assert found.hours == pytest.approx(1e6 * mean_s / 50 / 3600, rel=0.02)
    assert found.cores_busy > 0.98
    assert found.limit == "cores"
    assert found.again == 0


def test_storage_limits_by_its_bytes() -> None:
    found = Simulation(_with(bytes_in=3e8, bytes_out=1e8, storage=1e9, stream=1e9), 1).run(5000, 0)
    assert found.files_a_s == pytest.approx(1e9 / 4e8, rel=0.01)
    assert found.limit == "storage"
    assert found.cores_busy == pytest.approx(2.5 * 10 / 50, rel=0.05)


def test_one_stream_is_slower_than_the_storage_and_costs_core_time() -> None:
    found = Simulation(_with(bytes_in=1e9, bytes_out=1e9, storage=1e12, stream=2e8), 1).run(5000, 0)
    assert found.files_a_s == pytest.approx(50 / (10 + 5 + 5), rel=0.02)
    assert found.limit == "cores"


def test_the_queue_limits_by_its_seconds() -> None:
    found = Simulation(_with(queue_s=0.5), 1).run(5000, 0)
    assert found.files_a_s == pytest.approx(2.0, rel=0.01)
    assert found.limit == "scheduler"


def test_workers_that_die_cost_what_they_had_done() -> None:
    found = Simulation(_with(deaths=36.0, restart_s=0.0), 1).run(40_000, 0)
    share = 36 / 3600 * 10
    assert found.again == pytest.approx(math.exp(share) - 1, rel=0.05)
    assert found.files_a_s == pytest.approx(50 / ((math.exp(share) - 1) / share * 10), rel=0.02)


def test_stragglers_make_the_tail() -> None:
    short, long = (
        Simulation(_with(stragglers=share), 1).run(5000, 0).tail_s for share in (0.0, 0.02)
    )
    assert short == pytest.approx(10, abs=0.1)
    assert long > 50


def test_a_table_is_printed_from_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measured = {"seconds_a_file_and_worker": 20.0, "bytes_in": 5e7, "bytes_out": 1e8}
    measured |= {"caller_cpu_ms_a_file": 2.0, "scheduler_cpu_ms_a_file": 5.0}
    path = tmp_path / "measured.json"
    path.write_text(json.dumps(measured))
    command = ["archive", "--file", path, "--queue", path, "--cores", "10,100"]
    command += ["--simulated", "500"]
    monkeypatch.setattr(sys, "argv", [str(word) for word in command])
    archive.main()
    lines = capsys.readouterr().out.splitlines()
    assert "20.00 s on a core, 50.0 MB in, 100.0 MB out, 5.0 ms of the queue" in lines[0]
    assert [line.split("|")[1].strip() for line in lines[3:]] == ["10", "100"]

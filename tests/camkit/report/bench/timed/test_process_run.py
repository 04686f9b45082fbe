"""A process watched: its seconds, the memory of its tree, and what others took."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from camkit.report.bench.timed import process_run
from camkit.report.bench.timed.process_run import Job, TreeWatch, run_job, tree_rss_mb
from tests.capture_factory import write_tiny_captures

CHILD = "data = bytearray(80_000_000); print('up', flush=True); input()"
PARENT = f"""
import subprocess, sys
child = subprocess.Popen([sys.executable, "-c", {CHILD!r}], stdin=sys.stdin)
child.wait()
"""
LINUX = pytest.mark.skipif(not Path("/proc/stat").exists(), reason="this system has no /proc")


@LINUX
def test_memory_of_a_tree_counts_the_children() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as parent:
        assert parent.stdout is not None
        assert parent.stdin is not None
        assert parent.stdout.readline() == b"up\n"
        watch = TreeWatch(parent.pid)
        watch.start()
        found = tree_rss_mb(parent.pid)
        while not watch.peak_mb:
            pass
        watch.stop()
        parent.stdin.write(b"\n")
        parent.stdin.close()
    assert 80 < found < 200
    assert watch.peak_mb == pytest.approx(found, rel=0.1)
    assert tree_rss_mb(parent.pid) == 0


@pytest.mark.parametrize(
    ("busy_s", "own_s", "load"), [(2.0, 2.0, 0.0), (3.0, 2.0, 0.5), (1.0, 2.0, 0.0), (9, 2, 1.0)]
)
def test_load_of_others_is_what_is_neither_idle_nor_own(
    busy_s: float, own_s: float, load: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process_run.os, "cpu_count", lambda: 2)
    assert process_run._load_of_others(10.0, 10.0 + busy_s, own_s, elapsed_s=1.0) == load


def test_load_is_unknown_where_the_system_does_not_tell() -> None:
    assert process_run._load_of_others(None, 1.0, 0.5, 1.0) is None


def test_a_job_gives_first_and_steady_seconds_and_its_stages(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a", "b"])
    job = Job(
        files=(tmp_path / "a.dng", tmp_path / "b.dng"),
        bundle=str(bundle),
        out_dir=tmp_path / "out",
        options={"size": "M", "threads": 1, "mode": "whole"},
    )
    run = run_job(job)
    assert run.error is None
    assert run.seconds is not None
    assert len(run.steady_s) == len(run.steady_cpu_s) == 1
    assert run.steady_s[0] > 0
    assert 0 < sum(run.stages.values()) < run.seconds
    assert {"decode", "wiener", "network", "write"} <= set(run.stages)
    assert run.cpu_s is not None
    assert run.peak_rss_mb is not None
    assert run.peak_rss_mb > 50
    assert (tmp_path / "out" / "b.exr").is_file()


def test_a_slow_file_is_not_repeated(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a", "b"])
    files = (tmp_path / "a.dng", tmp_path / "b.dng")
    job = Job(files=files, bundle=str(bundle), out_dir=tmp_path / "out", options={"size": "M"})
    run = run_job(replace(job, repeat_within_s=0.0))
    assert run.error is None
    assert run.seconds is not None
    assert run.steady_s == ()


def test_a_job_that_takes_too_long_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process_run, "TIMEOUT_S", 0.05)
    run = run_job(Job(files=(tmp_path / "a.dng",), bundle="none", out_dir=tmp_path, options={}))
    assert run.seconds is None
    assert run.error == "it took longer than 0.05 s and was ended"


def test_a_job_that_fails_says_why(tmp_path: Path) -> None:
    (tmp_path / "a.dng").write_bytes(b"no picture")
    job = Job(files=(tmp_path / "a.dng",), bundle="none", out_dir=tmp_path, options={"mode": "?"})
    run = run_job(job)
    assert run.seconds is None
    assert run.error is not None
    assert "mode must be one of" in run.error

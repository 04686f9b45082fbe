"""Workers and schedulers that are lost: equal bits, nothing lost, one file per fault."""

import random
import threading
import time
from pathlib import Path

import pytest

import camkit
from camkit.errors import CamkitError
from camkit.runtime.batch.cluster import run as run_module
from camkit.runtime.batch.cluster.losses import Losses
from tests.capture_factory import write_tiny_captures
from tests.runtime.batch.cluster.farm import Farm

KILLS_ITS_WORKER = """
import os, signal
from camkit.runtime.batch import making

develop = getattr(making.make_file, "original", making.make_file)

def develop_or_die(source, *args, **kwargs):
    if source.stem == "huge":
        os.kill(os.getpid(), signal.SIGKILL)  # as the system does for want of memory
    return develop(source, *args, **kwargs)

develop_or_die.original = develop  # preloads are run twice
making.make_file = develop_or_die
"""
FILLS_ITS_WORKER = """
import time
from camkit.runtime.batch import making

develop = getattr(making.make_file, "original", making.make_file)

def develop_or_hoard(source, *args, **kwargs):
    held = []
    while source.stem == "huge":
        held.append(bytearray(50_000_000))
        held[-1][::4096] = b"x" * len(held[-1][::4096])
        time.sleep(0.02)
    return develop(source, *args, **kwargs)

develop_or_hoard.original = develop  # preloads are run twice
making.make_file = develop_or_hoard
"""


def _expected(captures: Path, out: Path) -> dict[str, bytes]:
    camkit.process(captures, bundle=captures / "tiny.camkit", out_dir=out)
    return _bytes(out)


def _bytes(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.exr"))}


class _Killer:
    """Kills something after some results, a moment later: there is progress, and no rhythm."""

    def __init__(self, farm: Farm, seed: int, every: int) -> None:
        self._farm, self._rng, self._every = farm, random.Random(seed), every
        self.results: list[str] = []
        self.kills: list[str] = []
        self._threads: list[threading.Timer] = []

    def __call__(self, result: camkit.FileResult) -> None:
        self.results.append(result.input.stem)
        if len(self.results) % self._every == 0:
            name = self._rng.choice(["one", "two"])
            self.kills.append(name)
            self._threads.append(threading.Timer(self._rng.uniform(0, 1), self._farm.kill, [name]))
            self._threads[-1].start()

    def join(self) -> None:
        for thread in self._threads:
            thread.join()


def _check_whole(results: list[camkit.FileResult], out: Path, expected: dict[str, bytes]) -> None:
    assert {r.status for r in results} == {"ok"}, [r.error for r in results if r.error]
    assert all(r.seconds["decode"] > 0 for r in results)
    assert _bytes(out) == expected
    names = [path.name for path in out.iterdir()]
    assert sorted(names) == sorted(
        name for picture in expected for name in (picture, picture[:-4] + ".camkit.json")
    )


@pytest.mark.slow
def test_workers_killed_at_random_cost_nothing(tmp_path: Path) -> None:
    captures, out = tmp_path / "in", tmp_path / "out"
    captures.mkdir()
    write_tiny_captures(captures, [f"shot{n:02}" for n in range(16)])
    expected = _expected(captures, tmp_path / "one")
    with Farm(tmp_path / "farm") as farm:
        for name in ("one", "two"):
            farm.add_worker(name)
        farm.wait(2)
        killer = _Killer(farm, seed=1, every=4)
        with farm.client() as client:
            results = camkit.process(
                captures,
                bundle=captures / "tiny.camkit",
                out_dir=out,
                client=client,
                on_result=killer,
            )
        killer.join()
    assert len(killer.kills) >= 3
    _check_whole(results, out, expected)


@pytest.mark.slow
def test_a_scheduler_that_is_lost_is_waited_for(tmp_path: Path) -> None:
    captures, out = tmp_path / "in", tmp_path / "out"
    captures.mkdir()
    write_tiny_captures(captures, [f"shot{n:02}" for n in range(8)])
    expected = _expected(captures, tmp_path / "one")
    with Farm(tmp_path / "farm") as farm:
        farm.add_worker("one")
        farm.wait(1)
        lost: list[str] = []
        heard: set[str] = set()

        def lose(result: camkit.FileResult) -> None:
            if not lost:
                lost.append(result.input.stem)
                farm.kill("scheduler")

        with farm.client() as client:
            results = camkit.process(
                captures,
                bundle=captures / "tiny.camkit",
                out_dir=out,
                client=client,
                on_result=lose,
                progress=lambda path, *_: heard.add(path.stem),
            )
    assert lost
    assert len(heard) > 4, "progress is heard of the new scheduler too"
    _check_whole(results, out, expected)


@pytest.mark.slow
def test_a_network_that_stays_lost_ends_the_run_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_tiny_captures(tmp_path, [f"shot{n:02}" for n in range(8)])
    monkeypatch.setattr(run_module, "WAIT_S", 8.0)
    notices: list[tuple[float, str]] = []
    with Farm(tmp_path / "farm") as farm:
        farm.add_worker("one")
        farm.wait(1)
        gone: list[float] = []

        def lose(_: camkit.FileResult) -> None:
            if not gone:
                gone.append(time.monotonic())
                farm.stop()

        with (
            farm.client() as client,
            pytest.raises(CamkitError, match=r"file\(s\) are left: run again with resume"),
        ):
            camkit.process(
                tmp_path,
                bundle=tmp_path / "tiny.camkit",
                out_dir=tmp_path / "out",
                client=client,
                on_result=lose,
                on_notice=lambda text: notices.append((time.monotonic(), text)),
            )
    assert notices[0][0] - gone[0] < 10, "told within ten seconds"


def test_a_file_that_died_with_its_worker_though_alone_has_failed() -> None:
    losses = Losses([])
    losses._counts = [0, 0]
    losses.add_all(0, was_alone=False)
    assert losses.fate(0) == "alone"
    losses.add_all(0, was_alone=False)
    assert losses.fate(0) == "alone", "others were under way: it may have been one of them"
    losses.add_all(0, was_alone=True)
    assert [losses.fate(n) for n in (0, 1)] == ["failed", "again"]


@pytest.mark.slow
def test_a_worker_that_dies_of_a_file_costs_that_file(tmp_path: Path) -> None:
    _one_file_is_lost(tmp_path, KILLS_ITS_WORKER)


@pytest.mark.slow
def test_a_worker_that_runs_out_of_memory_costs_one_file(tmp_path: Path) -> None:
    _one_file_is_lost(tmp_path, FILLS_ITS_WORKER)


def _one_file_is_lost(folder: Path, fault: str) -> None:
    captures, out = folder / "in", folder / "out"
    captures.mkdir()
    write_tiny_captures(captures, ["a", "b", "huge", "x", "y"])
    with Farm(folder / "farm") as farm:
        for name in ("one", "two"):
            farm.add_worker(name, memory="1200MB", preload=fault)
        farm.wait(2)
        with farm.client() as client:
            results = camkit.process(
                captures, bundle=captures / "tiny.camkit", out_dir=out, client=client
            )
    assert {r.input.stem: r.status for r in results} == {
        **dict.fromkeys("abxy", "ok"),
        "huge": "failed",
    }
    (lost,) = [r for r in results if r.status == "failed"]
    assert "more memory than a worker has" in (lost.error or "")
    assert sorted(_bytes(out)) == [f"{name}.exr" for name in "abxy"]
    assert len(list(out.iterdir())) == 8


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_two_hundred_captures_through_every_loss(tmp_path: Path) -> None:
    captures, out = tmp_path / "in", tmp_path / "out"
    captures.mkdir()
    write_tiny_captures(captures, [f"shot{n:03}" for n in range(200)])
    expected = _expected(captures, tmp_path / "one")
    with Farm(tmp_path / "farm") as farm:
        for name in ("one", "two"):
            farm.add_worker(name)
        farm.wait(2)

        killer = _Killer(farm, seed=2, every=7)

        def lose(result: camkit.FileResult) -> None:
            killer(result)
            if len(killer.results) in {60, 140}:
                farm.kill("scheduler")

        with farm.client() as client:
            results = camkit.process(
                captures,
                bundle=captures / "tiny.camkit",
                out_dir=out,
                client=client,
                on_result=lose,
            )
        killer.join()
    print(f"{len(killer.kills)} workers and 2 schedulers killed")
    assert sorted(killer.results) == sorted(r.input.stem for r in results)
    _check_whole(results, out, expected)

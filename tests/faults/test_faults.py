"""Whatever fails, wherever a run is killed: no hang, no half result, the other captures made."""

import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from camkit.runtime.raw import file_sha256
from tests.capture_factory import write_tiny_captures
from tests.faults.injection import Faults
from tests.faults.small_batch import End, run_small_batch

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks and counts calls on Linux")

FORMATS = {"exr": "exr", "tiff": "tif", "png": "png", "jpeg": "jpg", "dng": "dng"}
NAMES = ("a", "b")
EVERY = 22
"""Of the default run; the slow one takes every call."""


class Bench:
    """A folder of captures, and what their pictures must be."""

    def __init__(self, folder: Path, format_: str) -> None:
        self.folder, self.format = folder, format_
        self.out = folder / "out"
        write_tiny_captures(folder, list(NAMES))
        end = self.run(Faults())
        assert set(end.files) == set(NAMES)
        self.steps = len(end.seen)
        self.whole = self.pictures()

    def run(self, faults: Faults) -> End:
        """Run the batch."""
        return run_small_batch(self.folder, self.format, faults)

    def pictures(self) -> dict[str, str]:
        """Give picture -> hash."""
        return {p.name: file_sha256(p) for p in self.out.glob(f"*.{FORMATS[self.format]}")}

    def clear(self) -> None:
        """Forget all results."""
        shutil.rmtree(self.out)

    def files(self) -> set[str]:
        """Name what lies in the folder of results."""
        return {p.name for p in self.out.iterdir()} if self.out.is_dir() else set()

    def check_no_half(self) -> None:
        """Hold that pictures and sidecars come in pairs, whole, and nothing else lies about."""
        pictures = self.pictures()
        assert pictures.items() <= self.whole.items()
        proofs = {f"{Path(name).stem}.camkit.json" for name in pictures}
        assert self.files() == {*pictures, *proofs}

    def check_resume(self) -> None:
        """Hold that a run without faults completes the work."""
        end = self.run(Faults())
        assert all(status in {"ok", "skipped"} for status, _ in end.files.values()), end
        assert self.pictures() == self.whole
        self.check_no_half()


@pytest.fixture(scope="module")
def benches(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Bench]:
    @cache
    def made(format_: str) -> Bench:
        return Bench(tmp_path_factory.mktemp("faults"), format_)

    return made


def check_failing(bench: Bench, at: int) -> None:
    """Let one call fail; hold what must hold whatever it was."""
    bench.clear()
    end = bench.run(Faults(at=at))
    where = f"call {at}, {end.seen[at] if at < len(end.seen) else '-'}: {end}"
    assert end.signal == 0, where
    assert "Traceback" not in end.stderr, where
    if end.ended:
        assert "\n" not in end.ended, where
        assert bench.files() == set(), where
    else:
        failed = [error for status, error in end.files.values() if status == "failed"]
        assert set(end.files) == set(NAMES), where
        assert len(failed) <= 1, where
        assert all(error and "\n" not in error for error in failed), where
        assert len(bench.pictures()) == len(NAMES) - len(failed), where
    bench.check_no_half()
    bench.check_resume()


def check_killed(bench: Bench, at: int) -> None:
    """Kill the run at one call; hold that no name stands for half a picture, and go on."""
    bench.clear()
    end = bench.run(Faults(at=at, kill=True))
    assert end.signal == signal.SIGKILL, end
    assert bench.pictures().items() <= bench.whole.items()
    bench.check_resume()


def steps(bench: Bench, every: int) -> Iterator[int]:
    """Give the calls to try."""
    return iter(range(0, bench.steps, every))


def test_a_call_that_fails_costs_one_capture(benches: Callable[[str], Bench]) -> None:
    bench = benches("exr")
    for at in steps(bench, EVERY):
        check_failing(bench, at)


def test_a_killed_run_goes_on(benches: Callable[[str], Bench]) -> None:
    bench = benches("exr")
    for at in steps(bench, 2 * EVERY):
        check_killed(bench, at)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("format_", FORMATS)
def test_every_call_may_fail(benches: Callable[[str], Bench], format_: str) -> None:
    bench = benches(format_)
    for at in steps(bench, 1):
        check_failing(bench, at)
    print(f"{bench.format}: {bench.steps} calls failed in turn")


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("format_", FORMATS)
def test_a_run_may_be_killed_at_every_call(benches: Callable[[str], Bench], format_: str) -> None:
    bench = benches(format_)
    for at in steps(bench, 1):
        check_killed(bench, at)
    print(f"{bench.format}: killed at {bench.steps} calls in turn")

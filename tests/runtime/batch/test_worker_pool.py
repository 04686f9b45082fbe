"""A pool of worker processes: whatever ends one, each capture gets its picture or its reason."""

import asyncio
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import camkit
from camkit.runtime.batch import pool_process, worker_pool
from tests.capture_factory import write_tiny_captures
from tests.faulty_worker import COMMAND

NAMES = ["a", "die", "die-once", "wait", "hang", "cap", "lack", "fault"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pool")
    write_tiny_captures(folder, NAMES)
    (folder / "cut.dng").write_bytes((folder / "a.dng").read_bytes()[:2000])
    return folder


@pytest.fixture(scope="module")
def shared(folder: Path) -> Iterator[camkit.WorkerPool]:
    """A pool of one process, whose captures end as their names say."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool_process, "PROCESS", COMMAND)
        with camkit.WorkerPool(folder / "tiny.camkit", workers=1) as pool:
            yield pool


class Caller:
    """A submitted capture that can be cancelled, and that says when it is under way."""

    def __init__(self, pool: camkit.WorkerPool, folder: Path, name: str) -> None:
        self.gone, self.begun = threading.Event(), threading.Event()
        self.picture = folder / f"{name}.jpg"
        self.picture.unlink(missing_ok=True)
        self.future = pool.submit(
            folder / f"{name}.dng",
            self.picture,
            progress=lambda *_: self.begun.set(),
            cancel=self.gone,
            overwrite=True,
        )

    def error(self) -> BaseException | None:
        return self.future.exception(20)


def _pid(pool: camkit.WorkerPool) -> int:
    return pool._workers[0].child.pid


def _lives(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _until(condition: Callable[[], bool]) -> bool:
    """Return whether a condition comes true within some seconds."""
    for _ in range(800):
        if condition():
            return True
        time.sleep(0.01)
    return False


def test_a_capture_gets_the_bytes_of_process_and_its_progress(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    (made,) = camkit.process(
        folder / "a.dng", bundle=folder / "tiny.camkit", format="jpeg", out_dir=folder / "out"
    )
    assert made.output is not None
    shares: list[float] = []

    async def wait() -> camkit.FileResult:
        future = shared.submit(
            folder / "a.dng", folder / "a.jpg", progress=lambda n, all_: shares.append(n / all_)
        )
        return await asyncio.wrap_future(future)

    result = asyncio.run(wait())
    assert (folder / "a.jpg").read_bytes() == made.output.read_bytes()
    assert (result.status, result.warnings) == ("ok", made.warnings)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("cut", camkit.DecodeError, "cut.dng: .* cut off"),
        ("none", camkit.DecodeError, "none.dng"),
        ("cap", camkit.MemoryCapError, "raise the cap"),
        ("lack", camkit.WorkerError, "^not enough memory$"),
        ("fault", camkit.WorkerError, "unexpected ZeroDivisionError: of nobody"),
    ],
)
def test_each_error_of_a_capture_comes_back_as_it_is_and_ends_no_process(
    shared: camkit.WorkerPool, folder: Path, name: str, kind: type[Exception], text: str
) -> None:
    pid = _pid(shared)
    with pytest.raises(kind, match=text) as caught:
        Caller(shared, folder, name).future.result(20)
    assert type(caught.value) is kind
    assert getattr(caught.value, "need_bytes", 123_456_789) == 123_456_789
    assert _pid(shared) == pid


def test_a_capture_that_ends_a_process_gets_one_more_and_then_an_error(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    once, twice, behind = (Caller(shared, folder, name) for name in ("die-once", "die", "a"))
    assert once.future.result(20).output == once.picture
    assert "a first worker ended with signal 9; a second one" in once.future.result().warnings[-1]
    assert isinstance(twice.error(), camkit.WorkerError)
    assert "die.dng: 2 workers ended, the last one ended with signal 9" in str(twice.error())
    assert behind.future.result(20).status == "ok"
    assert not any("worker" in warning for warning in behind.future.result().warnings)
    assert not [*folder.glob("die.jpg*"), *folder.glob("*.part"), *folder.glob("*.claim")]


def test_a_capture_can_be_cancelled_while_it_waits_and_while_it_is_made(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    pid = _pid(shared)
    running, waiting, plain = (Caller(shared, folder, name) for name in ("wait", "a", "a"))
    assert running.begun.wait(20)
    waiting.gone.set()
    assert isinstance(waiting.error(), camkit.Cancelled)
    assert not running.future.done()
    running.gone.set()
    assert isinstance(running.error(), camkit.Cancelled)
    assert plain.error() is None
    forgotten = Caller(shared, folder, "wait")  # by the future itself, as asyncio does
    assert forgotten.begun.wait(20)
    assert forgotten.future.cancel()
    assert Caller(shared, folder, "a").error() is None
    assert _pid(shared) == pid


def test_what_the_functions_of_the_caller_raise_ends_the_capture(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    def fail(*_: object) -> bool:
        raise LookupError("of the caller")

    files = folder / "wait.dng", folder / "wait.jpg"
    for named in ({"progress": fail}, {"cancel": fail}):
        with pytest.raises(LookupError, match="of the caller"):
            shared.submit(*files, **named).result(20)  # type: ignore[arg-type]


def test_wrong_arguments_are_refused_before_any_work(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    with pytest.raises(camkit.ContractError, match="did you mean overwrite"):
        shared.submit("a.dng", "a.jpg", overwrit=True)  # type: ignore[call-arg]
    with pytest.raises(camkit.ContractError, match="jpeg_quality"):
        shared.submit("a.dng", "a.jpg", jpeg_quality="best")  # type: ignore[arg-type]
    with pytest.raises(camkit.ContractError, match=r"a file in \.jpg; got a\.jpeg"):
        shared.submit(folder / "a.dng", folder / "a.jpeg").result(20)
    with pytest.raises(camkit.ContractError, match=r"\.dng or \.exr or \.jpg .*; got a\.bmp"):
        shared.submit(folder / "a.dng", folder / "a.bmp").result(20)
    with pytest.raises(camkit.ContractError, match=r"did you mean workers\? known .* bundle,"):
        camkit.WorkerPool("duet", worker=2)  # type: ignore[call-arg]
    with pytest.raises(camkit.ContractError, match="workers must be >= 1"):
        camkit.WorkerPool("duet", workers=0)
    with pytest.raises(camkit.BundleError, match="no built-in bundle"):
        camkit.WorkerPool("no-such-camera")


def test_a_folder_is_made_and_what_is_in_the_way_is_said_of_the_picture(
    shared: camkit.WorkerPool, folder: Path
) -> None:
    new = folder / "made" / "below"
    made = shared.submit(folder / "a.dng", new / "s.jpg").result(20)
    assert made.output == new / "s.jpg"
    in_the_way = shared.submit(folder / "a.dng", new / "s.jpg")
    with pytest.raises(camkit.ContractError, match=r"add overwrite=True, or another picture$"):
        in_the_way.result(20)
    with pytest.raises(camkit.ContractError, match=r"s\.jpg is no folder; t\.jpg needs one"):
        shared.submit(folder / "a.dng", new / "s.jpg" / "t.jpg").result(20)
    long = new / ("s" * 251 + ".jpg")  # a name that the system refuses with the claim's suffix
    with pytest.raises(OSError, match="cannot write the picture: File name too long") as caught:
        shared.submit(folder / "a.dng", long).result(20)
    assert caught.value.filename == str(long)


def test_a_bundle_that_is_refused_refuses_the_pool(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[pool_process.WorkerProcess] = []
    begin = pool_process.WorkerProcess.__init__

    def note(worker: pool_process.WorkerProcess, setup: object) -> None:
        begin(worker, setup)  # type: ignore[arg-type]
        started.append(worker)

    monkeypatch.setattr(pool_process.WorkerProcess, "__init__", note)
    (tmp_path / "bad.camkit").write_bytes(b"no bundle")
    with pytest.raises(camkit.BundleError, match=r"bad\.camkit"):
        camkit.WorkerPool(tmp_path / "bad.camkit")
    assert [worker.child.poll() is None for worker in started] == [False, False]


def test_an_exception_cancels_all_captures_and_ends_a_process_that_hangs(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool_process, "PROCESS", COMMAND)
    for module in (worker_pool, pool_process):
        monkeypatch.setattr(module, "GRACE_S", 0.5)
    pool = camkit.WorkerPool(folder / "tiny.camkit", workers=1)
    running, waiting = Caller(pool, folder, "hang"), Caller(pool, folder, "a")
    assert running.begun.wait(20)
    with pytest.raises(KeyboardInterrupt), pool:
        raise KeyboardInterrupt
    assert isinstance(running.error(), camkit.Cancelled)
    assert isinstance(waiting.error(), camkit.Cancelled)
    assert not _lives(_pid(pool))
    assert not waiting.picture.exists()
    with pytest.raises(camkit.ContractError, match="the pool is closed"):
        pool.submit("a.dng", "a.jpg")


PROGRAM = """\
import os, signal, sys, threading
import camkit
from camkit.runtime.batch import pool_process

pool_process.PROCESS = sys.argv[1]
pool = camkit.WorkerPool(sys.argv[2] + "/tiny.camkit", workers=1)
begun = threading.Event()
pool.submit(sys.argv[2] + "/wait.dng", sys.argv[2] + "/killed.jpg", progress=lambda *_: begun.set())
begun.wait(20)
print(pool._workers[0].child.pid, flush=True)
if sys.argv[3] == "kill":
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(("end", "code"), [("kill", -signal.SIGKILL), ("leave open", 0)])
def test_processes_end_with_a_program_that_does_not_close_its_pool(
    folder: Path, end: str, code: int
) -> None:
    """Its script has no guard, which children of multiprocessing would need."""
    command = [sys.executable, "-c", PROGRAM, COMMAND, str(folder), end]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (code, "")
    pid = int(done.stdout)
    assert _until(lambda: not _lives(pid))
    assert not [*folder.glob("*.part"), *folder.glob("*.claim"), *folder.glob("killed*")]

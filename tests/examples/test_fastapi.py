"""The handler of the web service: a status and a reason for every end, and no file left."""

import asyncio
import importlib
import re
import sys
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import camkit

fastapi = pytest.importorskip("fastapi", reason="fastapi is not installed")
FOLDER = Path(__file__).resolve().parents[2] / "examples" / "fastapi"


class Upload:
    """A request of some bytes, whose capture ends in an error or a picture."""

    def __init__(self, error: Exception | None, data: bytes = b"12345678") -> None:
        self.app = SimpleNamespace(state=SimpleNamespace(workers=self))
        self._error, self._data = error, data

    async def stream(self) -> AsyncIterator[bytes]:
        yield self._data[:4]
        yield self._data[4:]

    async def is_disconnected(self) -> bool:
        return False

    async def make(self, source: Path, picture: Path, progress: Any, is_gone: Any) -> Any:
        assert source.read_bytes() == self._data
        progress(0.5)
        if self._error is not None:
            raise type(self._error)(str(self._error).replace("FILE", str(source)))
        picture.write_bytes(b"JPEG")
        return ("sigma \u03c3 is rough",)


@pytest.fixture
def app(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    yield importlib.import_module("app")
    for name in ("app", "workers"):  # other examples may have such names
        del sys.modules[name]


def _status(app: ModuleType, upload: Upload, key: str = "a.dng") -> tuple[int, str]:
    try:
        answer = asyncio.run(app.restore(key, upload))
    except fastapi.HTTPException as error:
        return error.status_code, f"{error.detail} {error.headers or ''}"
    return answer.status_code, answer.body.decode()


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [
        (None, 200, "JPEG"),
        (camkit.DecodeError("FILE: cut off"), 422, "capture.dng: cut off "),
        (camkit.ContractError("FILE is no mosaic"), 422, "capture.dng is no mosaic "),
        (
            camkit.MemoryCapError("raise max_mem_bytes"),
            507,
            "too large for this service: it takes 1 MB ",
        ),
        (camkit.Cancelled("gone"), 499, ""),
        (BrokenProcessPool("dead"), 500, "two workers ended while they made this capture "),
    ],
)
def test_each_end_has_its_status_and_leaves_no_file(
    app: ModuleType, tmp_path: Path, error: Exception | None, status: int, text: str
) -> None:
    assert _status(app, Upload(error)) == (status, text)
    assert not app.jobs
    assert not list(tmp_path.iterdir())


def test_warnings_come_with_the_picture_and_a_key_is_explained(app: ModuleType) -> None:
    answer = asyncio.run(app.restore("a.dng", Upload(None)))
    assert answer.headers["X-Camkit-Warnings"] == '["sigma \\u03c3 is rough"]'
    assert app.check_key("a-1.dng") == "a-1.dng"
    with pytest.raises(fastapi.HTTPException, match=r"a name .* and a suffix"):
        app.check_key("../a.dng")


def test_what_is_too_much_is_refused_before_it_is_kept(
    app: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "MOST_BYTES", 7)
    assert _status(app, Upload(None))[0] == 413
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(app, "jobs", {f"{n}.dng": 0.25 for n in range(app.WORKERS + app.WAITING)})
    assert _status(app, Upload(None)) == (
        503,
        "every place is taken; try again {'Retry-After': '1'}",
    )
    assert _status(app, Upload(None), "3.dng")[0] == 409
    assert asyncio.run(app.progress("3.dng")) == {"share": 0.25}


class Stand:
    """A worker that is a thread; its capture ends when it is cancelled."""

    def __init__(self, ends: int = 0) -> None:
        self.stop, self.share = SimpleNamespace(value=False), SimpleNamespace(value=0.0)
        self.pool, self._ends = self, ends

    def submit(self, *_: object) -> Future[None]:
        future: Future[None] = Future()
        if self._ends:
            future.set_exception(BrokenProcessPool("killed"))
            return future

        def wait() -> None:
            self.share.value = 0.5
            for _ in range(500):
                if self.stop.value:
                    break
                time.sleep(0.01)
            assert self.stop.value
            future.set_exception(camkit.Cancelled("stopped"))

        threading.Thread(target=wait).start()
        return future


async def _leaves() -> bool:
    return True


async def _make(workers: ModuleType, stands: list[Stand]) -> tuple[str, int]:
    """Return how a capture ended whose client leaves, and how many workers are left."""
    pool = workers.Workers(1)
    try:
        await pool.make(Path("in"), Path("out"), lambda _: None, _leaves)
    except (camkit.Cancelled, BrokenProcessPool) as error:
        return type(error).__name__, pool._free.qsize() + len(stands)
    return "made", 0


@pytest.mark.parametrize(
    ("ends", "expected"), [("01", "Cancelled"), ("10", "Cancelled"), ("111", "BrokenProcessPool")]
)
def test_a_client_that_leaves_cancels_and_a_worker_that_ends_is_replaced_once(
    app: ModuleType, monkeypatch: pytest.MonkeyPatch, ends: str, expected: str
) -> None:
    workers = sys.modules["workers"]
    stands = [Stand(int(end)) for end in ends]
    monkeypatch.setattr(workers, "Worker", lambda: stands.pop(0))
    name, left = asyncio.run(_make(workers, stands))
    assert name == expected
    assert left == (2 if ends == "01" else 1)


async def _ends_while_it_waits(workers: ModuleType) -> tuple[str, int]:
    """Return how a capture ends whose client leaves before a worker is free, and the free ones."""
    pool = workers.Workers(0)
    try:
        await pool.make(Path("in"), Path("out"), lambda _: None, _leaves)
    except camkit.Cancelled as error:
        return str(error), pool._free.qsize()
    return "made", pool._free.qsize()


async def _cancelled_request(workers: ModuleType, stand: Stand) -> tuple[bool, int]:
    """Return whether the worker of a request that is cancelled hears of it, and the free ones."""

    async def stays() -> bool:
        return False

    pool = workers.Workers(1)
    task = asyncio.create_task(pool.make(Path("in"), Path("out"), lambda _: None, stays))
    while not stand.share.value:
        await asyncio.sleep(0.01)
    task.cancel()
    await asyncio.wait([task])
    for _ in range(500):
        if pool._free.qsize():
            break
        await asyncio.sleep(0.01)
    return stand.stop.value, pool._free.qsize()


def test_a_worker_is_neither_waited_for_in_vain_nor_left_busy(
    app: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    workers, stand = sys.modules["workers"], Stand()
    assert asyncio.run(_ends_while_it_waits(workers)) == (
        "the client left before a worker was free",
        0,
    )
    monkeypatch.setattr(workers, "Worker", lambda: stand)
    assert asyncio.run(_cancelled_request(workers, stand)) == (True, 1)


def test_the_page_shows_the_code_as_it_is() -> None:
    page = (FOLDER.parents[1] / "docs" / "start" / "embedding.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(@app.put.*?)```", page, re.DOTALL)
    assert block in (FOLDER / "app.py").read_text(encoding="utf-8")

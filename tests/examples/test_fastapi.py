"""The handler of the web service: a status and a reason for every end, and no file left."""

import ast
import asyncio
import importlib
import re
import sys
import tempfile
import threading
import time
from collections.abc import AsyncIterator, Iterator
from concurrent.futures import Future
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import camkit

fastapi = pytest.importorskip("fastapi", reason="fastapi is not installed")
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples" / "fastapi"
DATA = b"12345678"
MOST_LINES = 40


class Upload:
    """A request of some bytes."""

    def __init__(self, *, leaves: bool = False, seconds: float = 0.0) -> None:
        self._leaves, self._seconds = leaves, seconds

    async def stream(self) -> AsyncIterator[bytes]:
        yield DATA[:4]
        await asyncio.sleep(self._seconds)
        yield DATA[4:]

    async def is_disconnected(self) -> bool:
        return self._leaves


class Pool:
    """A pool whose captures end in an error or a picture; one whose client leaves, by that."""

    error: Exception | None = None
    waits = False

    def __init__(self, *_: object, **__: object) -> None:
        """Start nothing."""

    def submit(self, source: Path, picture: Path, *, cancel: Any, progress: Any) -> Future[Any]:
        future: Future[Any] = Future()

        def make() -> None:
            assert source.read_bytes() == DATA
            progress(1, 4)
            while self.waits and not cancel.is_set():
                time.sleep(0.01)
            error = camkit.Cancelled("stopped") if self.waits else self.error
            if error is not None:
                text = str(error).replace("FILE", str(source))
                future.set_exception(type(error)(text))
            else:
                picture.write_bytes(b"JPEG")
                future.set_result(SimpleNamespace(warnings=("sigma \u03c3 is rough",)))

        threading.Thread(target=make).start()
        return future


@pytest.fixture
def app(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ModuleType]:
    monkeypatch.setattr(camkit, "WorkerPool", Pool)
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    yield importlib.import_module("app")
    del sys.modules["app"]  # other examples may have such a name


def _status(app: ModuleType, upload: Upload, key: str = "a.dng") -> tuple[int, str]:
    try:
        answer = asyncio.run(app.restore(key, upload))
    except fastapi.HTTPException as error:
        return error.status_code, f"{error.detail} {error.headers or ''}".strip()
    return answer.status_code, answer.body.decode()


@pytest.mark.parametrize(
    ("error", "status", "text"),
    [
        (None, 200, "JPEG"),
        (camkit.DecodeError("FILE: cut off"), 422, "/capture.dng: cut off"),
        (camkit.ContractError("FILE is no mosaic"), 422, "/capture.dng is no mosaic"),
        (camkit.MemoryCapError("raise max_mem_bytes"), 507, "raise max_mem_bytes"),
        (camkit.WorkerError("2 workers ended"), 500, "2 workers ended"),
    ],
)
def test_each_end_has_its_status_and_leaves_no_file(
    app: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception | None,
    status: int,
    text: str,
) -> None:
    monkeypatch.setattr(Pool, "error", error)
    assert _status(app, Upload()) == (status, text)
    assert not app.jobs
    assert not list(tmp_path.iterdir())


def test_a_client_that_leaves_cancels_its_capture(
    app: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Pool, "waits", True)
    assert _status(app, Upload(leaves=True))[1] == "stopped"
    assert not app.jobs
    assert not list(tmp_path.iterdir())


def test_warnings_come_with_the_picture(app: ModuleType) -> None:
    answer = asyncio.run(app.restore("a.dng", Upload()))
    assert answer.headers["X-Camkit-Warnings"] == '["sigma \\u03c3 is rough"]'


def test_what_is_too_much_is_refused_before_it_is_kept(
    app: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(app, "MOST_BYTES", 7)
    assert _status(app, Upload())[0] == 413
    monkeypatch.setattr(app, "UPLOAD_S", 0.01)
    assert _status(app, Upload(seconds=5.0))[0] == 408
    assert not list(tmp_path.iterdir())
    jobs = {f"{n}.dng": (1, 4) for n in range(app.PLACES - 1)}
    monkeypatch.setattr(app, "jobs", jobs)
    refusal = (503, "this key, or every place, is taken {'Retry-After': '1'}")
    assert _status(app, Upload(), "3.dng") == refusal
    jobs["more.dng"] = (0, 1)
    assert _status(app, Upload()) == refusal
    assert asyncio.run(app.progress("3.dng")) == (1, 4)
    assert asyncio.run(app.progress("no.dng")) is None


def test_the_example_is_short_and_the_page_shows_it_whole() -> None:
    text = (FOLDER / "app.py").read_text(encoding="utf-8")
    lines = {number for number, line in enumerate(text.splitlines(), 1) if line.strip()}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines -= set(range(node.lineno, (node.end_lineno or 0) + 1))
    assert len(lines) <= MOST_LINES
    page = (ROOT / "docs" / "start" / "embedding.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(import asyncio.*?)```", page, re.DOTALL)
    assert text.endswith(f'"""\n\n{block}')

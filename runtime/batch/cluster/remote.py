"""Code that runs on a worker: it checks whether it fits, takes bundles, makes pictures."""

import hashlib
import os
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from camkit.caller import Language, option_text, speaking_here
from camkit.runtime.batch.making import Common, Pipelines, try_task
from camkit.runtime.batch.tasks import NO_BUNDLE, Task
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult
from camkit.runtime.machine.memory import keep_freed_memory, trim_heap
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES, Options
from camkit.runtime.write_options import WriteOptions

if TYPE_CHECKING:
    from distributed import Worker

MEMORY: Final = "camkit_bytes"
"""Resource of a worker that files in the making share, whichever run they belong to."""
OWN_BYTES: Final = 150_000_000
"""What a worker with camkit takes before the first file (measured: 142 MB)."""
BUNDLES: Final = "camkit-bundles"
_TICK_S: Final = 1.0
_KEPT_RUNS: Final = 2

_lock = threading.Lock()
_busy: dict[str, int] = {}
_pipelines: OrderedDict[str, Pipelines] = OrderedDict()


@dataclass(frozen=True, slots=True, kw_only=True)
class Needs:
    """The needs of a run: what a worker must have.

    Attributes:
        run: Name of the run.
        bundles: SHA-256 of every bundle.
        file_bytes: Memory that one file may take.
        token: A file beside the pictures, made for this run.
        sources: Some captures of the run.
        language: Of the caller, in whose words a worker says why it does not fit.
    """

    run: str
    bundles: tuple[str, ...]
    file_bytes: int
    token: Path
    sources: tuple[Path, ...]
    language: Language = "python"

    @property
    def flag(self) -> str:
        """Name the resource that tells workers that fit from others."""
        return f"camkit_{self.run}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An order to a worker: one capture, under absolute names.

    Attributes:
        task: The capture and its picture; its bundle is NO_BUNDLE or a SHA-256.
        options: What changes the pixels.
        write: How the picture is written.
        mosaic: How to read a headerless mosaic.
        run: Name of the run.
        topic: Where progress is told; None for nowhere.
        number: Of the task in the run.
        file_bytes: Memory that it may take.
        language: Of the caller, in whose words messages come back.
    """

    task: Task
    options: Options
    write: WriteOptions
    mosaic: MosaicOptions | None
    run: str
    topic: str | None
    number: int
    file_bytes: int
    language: Language = "python"


def file_bytes(options: Options) -> int:
    """Return the memory that one file may take."""
    return options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES


def look(needs: Needs, dask_worker: "Worker") -> tuple[str | None, tuple[str, ...]]:
    """Return why this worker cannot serve a run (None if it can), and which bundles it lacks."""
    lacks = tuple(sha for sha in needs.bundles if not _bundle_path(sha, dask_worker).is_file())
    with speaking_here(needs.language):
        return _unfit(needs, dask_worker), lacks


def _unfit(needs: Needs, dask_worker: "Worker") -> str | None:
    memory, folder = _memory_bytes(dask_worker), needs.token.parent
    if memory < needs.file_bytes:
        return (
            f"has {memory // 10**6} MB for files, one may take {needs.file_bytes // 10**6} MB: "
            f"give it more or lower {option_text('max_mem_bytes')}"
        )
    if not needs.token.is_file():
        return f"does not see {folder}, where the pictures go"
    if not os.access(folder, os.W_OK):
        return f"may not write to {folder}"
    if not any(source.exists() for source in needs.sources):
        return f"does not see {needs.sources[0]}"
    return None


def take_bundle(sha256: str, data: bytes, dask_worker: "Worker") -> None:
    """Store a bundle for as long as this worker lives.

    Raises:
        OSError: If it cannot be written.
        ValueError: If it did not arrive whole.
    """
    if hashlib.sha256(data).hexdigest() != sha256:
        raise ValueError(f"the bundle {sha256[:16]}... did not arrive whole")
    path = _bundle_path(sha256, dask_worker)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}.part")
    part.write_bytes(data)
    part.replace(path)


async def offer(needs: Needs, dask_worker: "Worker") -> int:
    """Offer this worker to a run; return how many files it makes at once."""
    keep_freed_memory()
    memory = _memory_bytes(dask_worker)
    resources = {MEMORY: float(memory), needs.flag: 1e9}
    if any(dask_worker.state.total_resources.get(k) != v for k, v in resources.items()):
        await dask_worker.set_resources(**resources)
    return _slots(needs.file_bytes, dask_worker)


def forget(run: str) -> None:
    """Release what a run that has ended used."""
    with _lock:
        _pipelines.pop(run, None)


def busy(run: str) -> int:
    """Return the number of files of a run that are in the making here."""
    with _lock:
        return _busy.get(run, 0)


def make(order: Order) -> FileResult | None:
    """Make one picture.

    Returns:
        What became of it; None if another holds the claim of its output now.

    Raises:
        Cancelled: If the run gave it up, or the worker closes.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    with _lock:
        _busy[order.run] = _busy.get(order.run, 0) + 1
    try:
        common = Common(
            write=order.write,
            mosaic=order.mosaic,
            progress=None if order.topic is None else _teller(worker, order.topic, order.number),
            cancel=lambda: _is_given_up(worker, key),
        )
        with speaking_here(order.language):
            return try_task(_local(order.task, worker), _pipelines_of(order, worker), common)
    finally:
        trim_heap(OWN_BYTES + order.file_bytes // 2)
        with _lock:
            _busy[order.run] -= 1
            if not _busy[order.run]:
                del _busy[order.run]


def _local(task: Task, worker: "Worker") -> Task:
    if task.bundle == NO_BUNDLE:
        return task
    return replace(task, bundle=str(_bundle_path(task.bundle, worker)))


def _pipelines_of(order: Order, worker: "Worker") -> Pipelines:
    """Return the pipelines of a run; those of runs before last are let go."""
    with _lock:
        if order.run not in _pipelines:
            threads = order.options.threads
            if threads is None:
                slots = _slots(order.file_bytes, worker)
                threads = max(1, worker.state.nthreads // slots)
            _pipelines[order.run] = Pipelines(replace(order.options, threads=threads))
        _pipelines.move_to_end(order.run)
        while len(_pipelines) > _KEPT_RUNS:
            _pipelines.popitem(last=False)
        return _pipelines[order.run]


def _is_given_up(worker: "Worker", key: Any) -> bool:
    """Return whether nobody waits for a task any more: it, the worker or the scheduler is lost."""
    if worker.status.name not in ("running", "paused"):
        return True
    task = worker.state.tasks.get(key)
    return task is None or task.state not in ("executing", "long-running")


def _teller(worker: "Worker", topic: str, number: int) -> Callable[[Path, int, int], None]:
    """Return a progress that tells the caller, once a second."""
    last = 0.0

    def tell(_: Path, count: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _TICK_S or count >= total:
            last = now
            worker.log_event(topic, (number, count, total))

    return tell


def _slots(file_bytes: int, worker: "Worker") -> int:
    """Return the number of files of a size that fit a worker at once."""
    return max(1, min(worker.state.nthreads, _memory_bytes(worker) // file_bytes))


def _memory_bytes(worker: "Worker") -> int:
    """Return the memory that files may take: the worker's limit, or its share of the machine's."""
    from dask.system import CPU_COUNT
    from distributed.system import MEMORY_LIMIT

    share = min(1.0, worker.state.nthreads / CPU_COUNT)
    limit = worker.memory_manager.memory_limit or share * MEMORY_LIMIT
    return max(0, int(limit) - OWN_BYTES)


def _bundle_path(sha256: str, worker: "Worker") -> Path:
    return Path(worker.local_directory) / BUNDLES / f"{sha256}.camkit"

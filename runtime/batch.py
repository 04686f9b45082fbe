"""Many captures: which files, which bundle for each, where the pictures go, what is done already.

    files -> expand -> plan (bundles, names, clashes: errors before any work) -> run, `jobs` at once
          -> NAME.ext and NAME.camkit.json, claimed, written to part files and renamed

One file's failure never stops the others; `resume` skips only what a sidecar proves done.
"""

import glob
import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.runtime.cancel import Cancel, Cancelled
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult, WriteOptions, develop_file, proved_done
from camkit.runtime.files.in_memory import FilePath, list_paths
from camkit.runtime.files.regular_file import check_regular
from camkit.runtime.job.choices import check_idle
from camkit.runtime.options import LEAST_MAX_MEM_BYTES, Options
from camkit.runtime.output.claim import claimed
from camkit.runtime.output.sidecar import read_sidecar
from camkit.runtime.pipeline import Pipeline, load
from camkit.runtime.raw import named_bundle

logger = logging.getLogger(__name__)

FileProgress = Callable[[Path, int, int], None]

RAW_SUFFIXES: Final = frozenset(
    {".dng", ".arw", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".raf", ".rw2", ".orf", ".pef"}
    | {".srw", ".kdc", ".dcr", ".3fr", ".iiq", ".rwl"}
)
CAPTURE_SUFFIXES: Final = RAW_SUFFIXES | {".exr", ".tif", ".tiff", ".png"}
NO_BUNDLE: Final = "none"
_ELSEWHERE: Final = "another process makes this picture"
_NAMELESS: Final = "names no bundle; say --bundle NAME, or --bundle none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One input with what was decided for it before any work.

    Attributes:
        source: The capture.
        target: The picture to write.
        bundle: Name or path of the bundle; "none" only develops.
        refusal: Why the file cannot be done, when that is known beforehand.
        before: State of the target then; None without one.
    """

    source: Path
    target: Path
    bundle: str
    refusal: str | None = None
    before: tuple[int, int, int] | None = None


def expand(files: Sequence[FilePath]) -> list[Path]:
    """Give the captures named by files, folders and globs, each once, in the order given.

    A folder stands for the captures directly in it, by name, without the pictures that a sidecar
    beside them calls its output; a glob that matches nothing and a
    folder without captures stand for nothing; a file that does not exist is kept and fails later.
    """
    found: dict[Path, None] = {}
    for item in files:
        path = Path(item)
        if _is_unreachable(path):
            found[path] = None
        elif path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() in CAPTURE_SUFFIXES)
            found.update(dict.fromkeys(p for p in inside if p.is_file() and not _is_result(p)))
        elif not path.exists() and glob.has_magic(str(item)):
            # pathlib has no glob that takes an absolute pattern
            matches = sorted(Path(m) for m in glob.glob(str(item), recursive=True))  # noqa: PTH207
            found.update(dict.fromkeys(p for p in matches if p.is_file()))
        else:
            found[path] = None
    return list(found)


def _is_unreachable(path: Path) -> bool:
    """Tell a path that no file can have: a name that is too long, a byte 0, a loop of links."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    except (OSError, ValueError):
        return True
    return False


def _is_result(path: Path) -> bool:
    record = read_sidecar(path)
    return record is not None and Path(str(record["output"])).name == path.name


def list_tasks(sources: Sequence[Path], *, bundle: str | None, write: WriteOptions) -> list[Task]:
    """Decide bundle and output of every input, and refuse what cannot be before any work.

    Raises:
        ContractError: If two inputs would give one output, an output exists (and neither resume
            nor overwrite was asked for), or no input names a bundle.
    """
    tasks = [_make_task(source, bundle, write) for source in sources]
    sound = [t for t in tasks if t.refusal is None]
    _refuse_clashes(sound)
    nameless = [t for t in tasks if t.refusal is not None and t.refusal.endswith(_NAMELESS)]
    if nameless and not sound:
        names = ", ".join(str(t.source) for t in nameless)
        raise ContractError(
            f"no file names a bundle ({names}); say --bundle NAME, or --bundle none to develop only"
        )
    existing = [t.target for t in sound if t.target.exists()]
    if existing and not (write.resume or write.overwrite):
        listed = ", ".join(map(str, existing[:5]))
        raise ContractError(
            f"{len(existing)} output(s) exist ({listed}); say --resume, --overwrite, or another "
            "--out-dir"
        )
    return tasks


def _make_task(source: Path, bundle: str | None, write: WriteOptions) -> Task:
    target = write.out_dir / f"{source.stem}{write.suffix}"
    refusal = _refusal(source)
    chosen = bundle
    if chosen is None and refusal is None:
        chosen = named_bundle(source)
        if chosen is None:
            refusal = f"{source} {_NAMELESS}"
    return Task(
        source=source,
        target=target,
        bundle=chosen or NO_BUNDLE,
        refusal=refusal,
        before=_state_of(target),
    )


def _state_of(path: Path) -> tuple[int, int, int] | None:
    """Give what changes when a file is written anew; None without a file."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


def _refusal(source: Path) -> str | None:
    """Say why an input cannot be read, as far as that is known without opening it."""
    try:
        check_regular(source)
    except OSError as error:
        return f"cannot read {source}: {error.strerror or error}"
    except (DecodeError, ValueError) as error:
        return f"cannot read {source}: {error}"
    return None


def _refuse_clashes(tasks: Sequence[Task]) -> None:
    owners: dict[Path, Path] = {}
    for task in tasks:
        target = task.target.resolve()
        if target == task.source.resolve():
            raise ContractError(f"{task.source} would overwrite itself; choose another --out-dir")
        if target in owners:
            raise ContractError(
                f"{owners[target]} and {task.source} would both give {task.target}; "
                "run them into different folders"
            )
        owners[target] = task.source


def process(
    files: Sequence[str | Path] | str | Path,
    *,
    bundle: str | Path | None = None,
    options: Options | None = None,
    write: WriteOptions | None = None,
    mosaic: MosaicOptions | None = None,
    progress: FileProgress | None = None,
    cancel: Cancel | None = None,
    on_result: Callable[[FileResult], None] | None = None,
    **choices: object,
) -> list[FileResult]:
    """Turn captures into pictures, each with its sidecar.

    Args:
        files: Captures, folders or globs.
        bundle: Name or path; None takes the bundle each file names; "none" only develops.
        options: What changes the pixels. Single fields may also be given by name (size="S").
        write: Where and how to write, how many at once. Single fields also by name (jobs=2).
        mosaic: How to read headerless mosaics.
        progress: Called with (file, work done, work in all) from the working thread.
        cancel: Asked ten times a second; true ends the run with `Cancelled`, finished files stay.
        on_result: Called with each result as it is ready.
        **choices: Single fields of `Options` and `WriteOptions` by name.

    Returns:
        One result per input, in their order; failures carry their message.

    Raises:
        ContractError: For what can be refused before any work (see `list_tasks`).
        BundleError: If the named bundle is refused.
    """
    options, write = _with_choices(options or Options(), write or WriteOptions(), choices)
    sources = expand(list_paths(files))
    tasks = list_tasks(sources, bundle=None if bundle is None else str(bundle), write=write)
    if write.out_dir.exists() and not write.out_dir.is_dir():
        raise ContractError(f"{write.out_dir} is no folder; pictures need one as --out-dir")
    if write.format == "dng":
        if options.color == "acescg":
            raise ContractError("a DNG holds camera RGB; leave --color out or say camera")
        options = replace(options, color="camera")
    pipelines = _Pipelines(_shared(options, write.jobs))
    if bundle is not None and tasks:
        pipelines.get(str(bundle))
    write.out_dir.mkdir(parents=True, exist_ok=True)

    common = _Common(write=write, mosaic=mosaic, progress=progress, cancel=cancel)

    def run(task: Task) -> FileResult:
        result = _run_task(task, pipelines, common)
        if on_result is not None:
            on_result(result)
        return result

    if write.jobs == 1:
        return [run(task) for task in tasks]
    with ThreadPoolExecutor(write.jobs, thread_name_prefix="camkit") as pool:
        return list(pool.map(run, tasks))


def _with_choices(
    options: Options, write: WriteOptions, choices: dict[str, object]
) -> tuple[Options, WriteOptions]:
    names = set(Options.__dataclass_fields__), set(WriteOptions.__dataclass_fields__)
    unknown = set(choices) - names[0] - names[1]
    if unknown:
        raise ContractError(
            f"unknown option(s) {', '.join(sorted(unknown))}; known are "
            f"{', '.join(sorted(names[0] | names[1]))}"
        )
    if "out_dir" in choices:
        choices = {**choices, "out_dir": Path(str(choices["out_dir"]))}
    return (
        replace(options, **{k: v for k, v in choices.items() if k in names[0]}),  # type: ignore[arg-type]
        replace(write, **{k: v for k, v in choices.items() if k in names[1]}),  # type: ignore[arg-type]
    )


def _shared(options: Options, jobs: int) -> Options:
    """Share threads and memory among the jobs, so that together they keep to the caller's.

    What the process holds anyway counts once; without a cap every job takes the default.
    """
    if jobs == 1:
        return options
    from camkit.runtime.job.walker import FIXED_BYTES
    from camkit.runtime.network.engine import available_threads

    threads = max(1, available_threads(options.threads) // jobs)
    if options.max_mem_bytes is None:
        return replace(options, threads=threads)
    each = FIXED_BYTES + (options.max_mem_bytes - FIXED_BYTES) // jobs
    if each < LEAST_MAX_MEM_BYTES:
        raise ContractError(
            f"{options.max_mem_bytes // 10**6} MB shared by {jobs} jobs are {each // 10**6} MB "
            f"each, {FIXED_BYTES // 10**6} of them in common; a job needs at least "
            f"{LEAST_MAX_MEM_BYTES // 10**6} MB: raise --max-mem or lower --jobs"
        )
    return replace(options, threads=threads, max_mem_bytes=each)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Common:
    """What all tasks of a run share."""

    write: WriteOptions
    mosaic: MosaicOptions | None
    progress: FileProgress | None
    cancel: Cancel | None


class _Pipelines:
    """One pipeline per bundle, made when first needed."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._made: dict[str, Pipeline] = {}
        self._lock = threading.Lock()

    def get(self, bundle: str) -> Pipeline:
        with self._lock:
            if bundle not in self._made:
                name = None if bundle.lower() == NO_BUNDLE else bundle
                made = load(name, options=self._options)
                check_idle(made.bundle, self._options)
                self._made[bundle] = made
            return self._made[bundle]


def _run_task(task: Task, pipelines: _Pipelines, common: _Common) -> FileResult:
    if task.refusal is not None:
        return FileResult.failure(task.source, None, task.refusal)
    named = None if task.bundle.lower() == NO_BUNDLE else task.bundle
    try:
        pipeline = pipelines.get(task.bundle)
        with claimed(task.target) as ours:
            if not ours:
                return FileResult.skip(task.source, task.target, pipeline, _ELSEWHERE)
            return _make(task, pipeline, common)
    except Cancelled:
        raise
    except (CamkitError, OSError) as error:
        logger.debug("%s failed", task.source, exc_info=error)
        told = f"{error}"
        if isinstance(error, OSError) and error.strerror is not None:
            told = f"cannot write {task.target}: {error.strerror}"
        return FileResult.failure(task.source, named, told)
    except MemoryError as error:
        logger.debug("%s failed", task.source, exc_info=error)
        return FileResult.failure(task.source, named, f"not enough memory: {error}".rstrip(": "))


def _make(task: Task, pipeline: Pipeline, common: _Common) -> FileResult:
    """Make a picture that nobody else makes now, unless it is done already.

    Raises:
        ContractError: If somebody put another file in its place since the run began.
    """
    write = common.write
    appeared = _state_of(task.target) != task.before
    if write.resume or appeared:
        if proved_done(task.source, task.target, pipeline, write, common.mosaic):
            return FileResult.skip(task.source, task.target, pipeline, *[_ELSEWHERE][:appeared])
        if appeared and task.target.exists() and not write.overwrite:
            raise ContractError(f"{task.target} appeared since the run began; it is left as it is")
    tick = None if common.progress is None else _tick(common.progress, task.source)
    return develop_file(
        task.source,
        task.target,
        pipeline,
        write,
        mosaic=common.mosaic,
        progress=tick,
        cancel=common.cancel,
    )


def _tick(progress: FileProgress, source: Path) -> Callable[[int, int], None]:
    return lambda done, total: progress(source, done, total)

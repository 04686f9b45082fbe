"""One capture of many: claimed, made by the pipeline of its bundle, told as a result."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.errors import CamkitError, ContractError, unexpected
from camkit.runtime.batch.tasks import NO_BUNDLE, Task, state_of
from camkit.runtime.cancel import Cancel, Cancelled
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult, make_file, proved_done
from camkit.runtime.job.choices import check_idle
from camkit.runtime.kind import kind_without_bundle
from camkit.runtime.options import Options
from camkit.runtime.output.claim import claimed
from camkit.runtime.pipeline import Pipeline, load
from camkit.runtime.write_options import WriteOptions

logger = logging.getLogger(__name__)

FileProgress = Callable[[Path, int, int], None]

ELSEWHERE: Final = "another process makes this picture"


@dataclass(frozen=True, slots=True, kw_only=True)
class Common:
    """The settings that all tasks of a run share."""

    write: WriteOptions
    mosaic: MosaicOptions | None
    progress: FileProgress | None
    cancel: Cancel | None


class Pipelines:
    """One pipeline per bundle, and per kind of camera without one, made when first needed."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._pipelines: dict[tuple[str, str | None], Pipeline] = {}
        self._lock = threading.Lock()

    def get(self, bundle: str, source: Path | None = None) -> Pipeline:
        """Return the pipeline of a bundle, "none" for one that only develops.

        Args:
            bundle: Name or path.
            source: The capture, which without a bundle says what kind of camera took it.

        Raises:
            BundleError: If the bundle is refused.
            ContractError: If it cannot do what the options ask.
        """
        is_bare = bundle.lower() == NO_BUNDLE
        kind = kind_without_bundle(source, self._options).name if is_bare else None
        with self._lock:
            if (bundle, kind) not in self._pipelines:
                name = None if is_bare else bundle
                pipeline = load(name, kind=kind, options=self._options)
                check_idle(pipeline.bundle, self._options)
                self._pipelines[bundle, kind] = pipeline
            return self._pipelines[bundle, kind]


def run_task(task: Task, pipelines: Pipelines, common: Common) -> FileResult:
    """Make the picture of one task; an error becomes its result.

    Raises:
        Cancelled: If the caller wished so.
    """
    result = try_task(task, pipelines, common)
    if result is None:
        pipeline = pipelines.get(task.bundle, task.source)
        return FileResult.skip(task.source, task.target, pipeline, ELSEWHERE)
    return result


def try_task(task: Task, pipelines: Pipelines, common: Common) -> FileResult | None:
    """Make the picture of one task; return None if another process makes it now.

    Raises:
        Cancelled: If the caller wished so.
    """
    if task.refusal is not None:
        return FileResult.failure(task.source, None, task.refusal)
    bundle = None if task.bundle.lower() == NO_BUNDLE else task.bundle
    try:
        pipeline = pipelines.get(task.bundle, task.source)
        with claimed(task.target) as ours:
            return _make(task, pipeline, common) if ours else None
    except Cancelled:
        raise
    except (CamkitError, OSError) as error:
        logger.debug("%s failed", task.source, exc_info=error)
        text = f"{error}"
        if isinstance(error, OSError) and error.strerror is not None:
            text = f"cannot write {task.target}: {error.strerror}"
        return FileResult.failure(task.source, bundle, text)
    except MemoryError as error:
        logger.debug("%s failed", task.source, exc_info=error)
        return FileResult.failure(task.source, bundle, f"not enough memory: {error}".rstrip(": "))
    except Exception as error:
        logger.debug("%s failed", task.source, exc_info=error)
        return FileResult.failure(task.source, bundle, unexpected(error))


def _make(task: Task, pipeline: Pipeline, common: Common) -> FileResult:
    """Make a picture that nobody else makes now, unless it is done already.

    Raises:
        ContractError: If somebody put another file in its place since the run began.
    """
    write = common.write
    appeared = state_of(task.target) != task.target_state
    if write.resume or appeared:
        if proved_done(task.source, task.target, pipeline, write, common.mosaic):
            return FileResult.skip(task.source, task.target, pipeline, *[ELSEWHERE][:appeared])
        if appeared and task.target.exists() and not write.overwrite:
            raise ContractError(f"{task.target} appeared since the run began; it is left as it is")
    tick = None if common.progress is None else _tick(common.progress, task.source)
    return make_file(
        task.source,
        task.target,
        pipeline,
        write,
        mosaic=common.mosaic,
        progress=tick,
        cancel=common.cancel,
    )


def _tick(progress: FileProgress, source: Path) -> Callable[[int, int], None]:
    return lambda count, total: progress(source, count, total)

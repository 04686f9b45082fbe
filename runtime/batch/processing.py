"""Many captures become pictures: planned before any work, then made, `jobs` at once."""

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import check_value
from camkit.kinds import Kind
from camkit.progress import working
from camkit.runtime.batch.batch_progress import PictureCount
from camkit.runtime.batch.making import Common, FileProgress, Pipelines, run_task
from camkit.runtime.batch.sources import expand, unmatched_text
from camkit.runtime.batch.tasks import NO_BUNDLE, Task, list_tasks
from camkit.runtime.cancel import Cancel, check_cancel
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.development import FileResult
from camkit.runtime.face.keywords import ProcessKeywords
from camkit.runtime.files.in_memory import FilePath, list_paths
from camkit.runtime.kind import kind_without_bundle
from camkit.runtime.options import (
    LEAST_MAX_MEM_BYTES,
    Options,
    check_names,
    kind_option_names,
    plain_names,
    with_absolute_files,
    with_choices,
)
from camkit.runtime.write_options import WriteOptions

if TYPE_CHECKING:
    from distributed import Client

logger = logging.getLogger(__name__)


def process(  # noqa: PLR0913 - each says one thing to its caller
    files: Sequence[FilePath] | FilePath,
    *,
    bundle: FilePath | None = None,
    options: Options | None = None,
    write: WriteOptions | None = None,
    mosaic: MosaicOptions | None = None,
    progress: FileProgress | None = None,
    cancel: Cancel | None = None,
    on_result: Callable[[FileResult], None] | None = None,
    client: "Client | None" = None,
    on_notice: Callable[[str], None] | None = None,
    **choices: Unpack[ProcessKeywords],
) -> list[FileResult]:
    """Process captures to pictures, each with its sidecar.

    Args:
        files: Captures, folders or globs.
        bundle: Name or path; None takes the bundle each file names; "none" only develops.
        options: What changes the pixels. Single fields may also be given by name (size="S").
        write: Where and how to write, how many at once. Single fields also by name (jobs=2).
        mosaic: How to read headerless mosaics.
        progress: Called with (file, work done, work in all) from the working thread.
        cancel: Asked ten times a second; true ends the run with `Cancelled`, finished files stay.
        on_result: Called with each result as it is ready.
        client: Of dask.distributed; its workers make the pictures, each file a task. They must see
            captures and `out_dir` under the same absolute names. `threads` and `max_mem_bytes` are
            those of a file then.
        on_notice: Called with what concerns no single file, such as a worker that is left out or
            a glob that matches nothing; None logs it.
        **choices: Single fields of `Options` and `WriteOptions` by name.

    Returns:
        One result per input, in their order; failures carry their message.

    Raises:
        ContractError: For what can be refused before any work (see `list_tasks`).
        BundleError: If the named bundle is refused.
        CamkitError: If scheduler or workers of `client` are lost and do not come back.
    """
    check_value("bundle", bundle, str | PathLike | None)
    check_value("mosaic", mosaic, MosaicOptions | None)
    check_cancel(cancel)
    options, write = _with_choices(
        Options() if options is None else options,
        WriteOptions() if write is None else write,
        choices,
    )
    if client is not None:
        options = with_absolute_files(options)
    if write.out_dir.exists() and not write.out_dir.is_dir():
        raise ContractError(
            f"{write.out_dir} is no folder; pictures need one as {option_text('out_dir')}"
        )
    if write.format == "dng":
        if options.color == "acescg":
            raise ContractError(
                f"a DNG holds camera RGB; leave {option_text('color')} out or use camera"
            )
        options = replace(options, color="camera")
    if client is not None and write.jobs > 1:
        raise ContractError("jobs are those of one process; leave them out with a client")
    bundle_name = None if bundle is None else str(bundle)
    pipelines = Pipelines(_shared(options, write.jobs))
    kind = kind_of_run(bundle_name, options, pipelines)
    unmatched: list[str] = []
    sources = expand(list_paths(files), kind, options.halves, unmatched.append)
    if not sources:
        return []
    notice = on_notice or logger.warning
    if unmatched:
        notice(unmatched_text(unmatched))
    tasks = list_tasks(sources, bundle=bundle_name, write=write, options=options, kind=kind)
    write.out_dir.mkdir(parents=True, exist_ok=True)
    for folder in {task.target.parent for task in tasks}:
        folder.mkdir(parents=True, exist_ok=True)
    common = Common(write=write, mosaic=mosaic, progress=progress, cancel=cancel)
    with working("making pictures", len(tasks), unit="pictures") as task:
        count = PictureCount(task, progress, on_result)
        if client is None:
            common = replace(common, progress=count.progress)
            return _process_here(tasks, pipelines, common, count.result)
        from camkit.runtime.batch.cluster.run import Wishes, process_on_cluster

        # only results are counted: shares of pictures would cost messages
        wishes = Wishes(
            options=options,
            common=common,
            pipelines=pipelines,
            on_result=count.result,
            notice=notice,
        )
        return process_on_cluster(client, tasks, wishes)


def _process_here(
    tasks: Sequence[Task],
    pipelines: Pipelines,
    common: Common,
    on_result: Callable[[FileResult], None],
) -> list[FileResult]:
    def run(task: Task) -> FileResult:
        result = run_task(task, pipelines, common)
        on_result(result)
        return result

    if common.write.jobs == 1:
        return [run(task) for task in tasks]
    with ThreadPoolExecutor(common.write.jobs, thread_name_prefix="camkit") as pool:
        return list(pool.map(run, tasks))


def _with_choices(
    options: Options, write: WriteOptions, choices: Mapping[str, object]
) -> tuple[Options, WriteOptions]:
    check_value("write", write, WriteOptions)
    names = set(WriteOptions.__dataclass_fields__)
    check_names(choices, names.union(plain_names(), kind_option_names()), process)
    if isinstance(out_dir := choices.get("out_dir"), str | PathLike):
        choices = {**choices, "out_dir": Path(out_dir)}
    return (
        with_choices(options, {k: v for k, v in choices.items() if k not in names}),
        replace(write, **{k: v for k, v in choices.items() if k in names}),  # type: ignore[arg-type]
    )


def kind_of_run(bundle: str | None, options: Options, pipelines: Pipelines) -> Kind | None:
    """Return the kind of all captures of a run; None where each file says its own.

    Raises:
        BundleError: If the named bundle is refused.
        ContractError: If it cannot do what the options ask.
    """
    if bundle is not None and bundle.lower() != NO_BUNDLE:
        return pipelines.get(bundle).kind
    return kind_without_bundle(None, options) if options.of_kind else None


def _shared(options: Options, jobs: int) -> Options:
    """Divide threads and memory among the jobs, so that together they keep the caller's limits.

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
            f"{LEAST_MAX_MEM_BYTES // 10**6} MB: raise {option_text('max_mem_bytes')} or lower "
            f"{option_text('jobs')}"
        )
    return replace(options, threads=threads, max_mem_bytes=each)

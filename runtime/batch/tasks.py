"""Decisions about every input before any work: its bundle, its picture, why it cannot be made."""

import logging
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError, unexpected
from camkit.kinds import Kind
from camkit.runtime.batch.sources import refusal_of
from camkit.runtime.kind import RuntimePart, kind_without_bundle, runtime_part
from camkit.runtime.options import Options
from camkit.runtime.write_options import WriteOptions

logger = logging.getLogger(__name__)

NO_BUNDLE: Final = "none"
_NAMELESS: Final = "names no bundle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One input with what was decided for it before any work.

    Attributes:
        source: The capture.
        target: The picture to write.
        bundle: Name or path of the bundle; "none" only develops.
        refusal: Why the file cannot be done, when that is known beforehand.
        target_state: State of the target then; None without one.
        extra_files: Further files that may appear.
    """

    source: Path
    target: Path
    bundle: str
    refusal: str | None = None
    target_state: tuple[int, int] | None = None
    extra_files: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Return every file that may appear, the main one first."""
        return (self.target, *self.extra_files)

    @property
    def own_files(self) -> tuple[Path, ...]:
        """Return the files among these that are the capture itself."""
        source = self.source.resolve()
        return tuple(path for path in self.files if path.resolve() == source)


def list_tasks(
    sources: Sequence[Path],
    *,
    bundle: str | None,
    write: WriteOptions,
    options: Options | None = None,
    kind: Kind | None = None,
    writes: bool = True,
) -> list[Task]:
    """Decide bundle and outputs of every input, and refuse impossible ones before any work.

    Args:
        sources: The captures.
        bundle: Name or path; None takes the bundle each file names; "none" only develops.
        write: Where and how to write.
        options: What changes the products, of which those of a kind say what kind a capture is.
        kind: Of the bundle that is named; None without one.
        writes: False for a plan, which may name the input itself as an output.

    Raises:
        ContractError: If an input would overwrite itself, two inputs would give one output, an
            output exists (and neither resume nor overwrite was asked for), or no input names a
            bundle.
    """
    folders = _folders(sources, write)
    settings = options or Options()
    parts = [runtime_part((kind or kind_without_bundle(s, settings)).name) for s in sources]
    outputs = [_outputs(s, p, settings, write) for s, p in zip(sources, parts, strict=True)]
    if outputs and all(isinstance(names, ContractError) for names in outputs):
        raise next(names for names in outputs if isinstance(names, ContractError))
    tasks = [
        _make_task(source, bundle, folder, part, names)
        for source, folder, part, names in zip(sources, folders, parts, outputs, strict=True)
    ]
    sound = [t for t in tasks if t.refusal is None]
    if writes:
        _refuse_themselves(sound)
    _refuse_clashes(sound)
    nameless = [t for t in tasks if t.refusal is not None and f" {_NAMELESS}; " in t.refusal]
    if nameless and not sound:
        names = ", ".join(str(t.source) for t in nameless)
        raise ContractError(
            f"no file names a bundle ({names}); name one by {_bundle_options()}: photographs are "
            "developed only, photons are fitted by formulas alone"
        )
    existing = [p for t in sound for p in t.files if p.exists() and p not in t.own_files]
    if existing and not (write.resume or write.overwrite):
        listed = ", ".join(map(str, existing[:5]))
        raise ContractError(
            f"{len(existing)} output(s) exist ({listed}); add {option_text('resume')}, "
            f"{option_text('overwrite')}, or another {option_text('out_dir')}"
        )
    return tasks


def _bundle_options() -> str:
    return f"{option_text('bundle')}, or use {option_text('bundle', 'none')}"


def _folders(sources: Sequence[Path], write: WriteOptions) -> list[Path]:
    """Return the folder of every picture."""
    if not write.keep_folders or not sources:
        return [write.out_dir] * len(sources)
    parents = [source.absolute().parent for source in sources]
    common = os.path.commonpath(parents)
    return [write.out_dir / parent.relative_to(common) for parent in parents]


def _outputs(
    source: Path, part: RuntimePart, options: Options, write: WriteOptions
) -> tuple[str, ...] | ContractError:
    """Return the files of an input, the main one first; or the reason why it has none."""
    try:
        return part.outputs.names(source, options, write)
    except ContractError as error:
        return error


def _make_task(
    source: Path,
    bundle: str | None,
    folder: Path,
    part: RuntimePart,
    names: tuple[str, ...] | ContractError,
) -> Task:
    refusal = refusal_of(source)
    if isinstance(names, ContractError):
        names, refusal = (source.stem,), refusal or str(names)
    target, *extra_files = (folder / name for name in names)
    bundle_name = bundle
    if bundle_name is None and refusal is None:
        try:
            bundle_name = part.bundle_of(source)
        except Exception as error:
            logger.debug("%s failed", source, exc_info=error)
            refusal = f"cannot read {source}: {unexpected(error)}"
        else:
            if bundle_name is None:
                refusal = f"{source} {_NAMELESS}; name one by {_bundle_options()}"
    return Task(
        source=source,
        target=target,
        bundle=bundle_name or NO_BUNDLE,
        refusal=refusal,
        target_state=state_of(target),
        extra_files=tuple(extra_files),
    )


def state_of(path: Path) -> tuple[int, int] | None:
    """Return the values that change when a file is written anew; None without a file.

    Its inode does too, but every machine may see another one.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size


def _refuse_themselves(tasks: Sequence[Task]) -> None:
    for task in tasks:
        if task.own_files:
            raise ContractError(
                f"{task.source} would overwrite itself; choose another {option_text('out_dir')}"
            )


def _refuse_clashes(tasks: Sequence[Task]) -> None:
    owners: dict[Path, Path] = {}
    for task in tasks:
        for path in task.files:
            target = path.resolve()
            if target in owners:
                raise ContractError(
                    f"{owners[target]} and {task.source} would both give {path}; "
                    f"keep their folders ({option_text('keep_folders')}), or run them into "
                    "different ones"
                )
            owners[target] = task.source

"""What is decided for every input before any work: its bundle, its picture, why it cannot be."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.errors import ContractError
from camkit.runtime.batch.sources import refusal_of
from camkit.runtime.development import WriteOptions
from camkit.runtime.raw import named_bundle

NO_BUNDLE: Final = "none"
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
    before: tuple[int, int] | None = None


def list_tasks(sources: Sequence[Path], *, bundle: str | None, write: WriteOptions) -> list[Task]:
    """Decide bundle and output of every input, and refuse what cannot be before any work.

    Raises:
        ContractError: If two inputs would give one output, an output exists (and neither resume
            nor overwrite was asked for), or no input names a bundle.
    """
    folders = _folders(sources, write)
    tasks = [
        _make_task(source, bundle, folder / f"{source.stem}{write.suffix}")
        for source, folder in zip(sources, folders, strict=True)
    ]
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


def _folders(sources: Sequence[Path], write: WriteOptions) -> list[Path]:
    """Give the folder of every picture."""
    if not write.keep_folders or not sources:
        return [write.out_dir] * len(sources)
    parents = [source.absolute().parent for source in sources]
    common = os.path.commonpath(parents)
    return [write.out_dir / parent.relative_to(common) for parent in parents]


def _make_task(source: Path, bundle: str | None, target: Path) -> Task:
    refusal = refusal_of(source)
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
        before=state_of(target),
    )


def state_of(path: Path) -> tuple[int, int] | None:
    """Give what changes when a file is written anew; None without a file.

    Its inode does too, but every machine may see another one.
    """
    try:
        found = path.stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size


def _refuse_clashes(tasks: Sequence[Task]) -> None:
    owners: dict[Path, Path] = {}
    for task in tasks:
        target = task.target.resolve()
        if target == task.source.resolve():
            raise ContractError(f"{task.source} would overwrite itself; choose another --out-dir")
        if target in owners:
            raise ContractError(
                f"{owners[target]} and {task.source} would both give {task.target}; "
                "keep their folders (--keep-folders), or run them into different ones"
            )
        owners[target] = task.source

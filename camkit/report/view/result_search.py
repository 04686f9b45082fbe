"""Results of `camkit process`, found by their files, their sidecars or their folders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from camkit.errors import DecodeError
from camkit.report.view.record_shape import record_fault
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.sidecar import SIDECAR_SUFFIX, read_sidecar, sidecar_path
from camkit.runtime.raw import file_sha256

ARCHIVE_SUFFIX: Final = ".npz"


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewedResult:
    """A result that is shown.

    Attributes:
        path: Its main file.
        record: Its sidecar; None without one.
        notes: What is doubtful of it.
    """

    path: Path
    record: Mapping[str, Any] | None
    notes: tuple[str, ...] = field(default=())

    @property
    def is_archive(self) -> bool:
        """Return whether it holds arrays, as photons become them, and not a picture."""
        return self.path.suffix.lower() == ARCHIVE_SUFFIX


def find_results(files: Sequence[FilePath]) -> list[ViewedResult]:
    """Return the results of files, sidecars and folders, each once, in the order given.

    Args:
        files: Pictures or archives, any file that lies beside one, their sidecars, or folders of
            them, which stand for the sidecars directly in them.

    Raises:
        DecodeError: If one is not there, a sidecar cannot be read, or a folder has none.
    """
    results: dict[Path, ViewedResult] = {}
    for item in files:
        for path in _inside(Path(item)):
            result = _result_of(path)
            results.setdefault(result.path.resolve(), result)
    return list(results.values())


def _inside(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    sidecars = sorted(path.glob(f"*{SIDECAR_SUFFIX}"))
    if not sidecars:
        raise DecodeError(
            f"{path} holds no result: no file NAME{SIDECAR_SUFFIX}, as camkit process writes them"
        )
    return sidecars


def _result_of(path: Path) -> ViewedResult:
    if not path.is_file():
        raise DecodeError(f"cannot read {path}: there is no such file")
    is_sidecar = is_sidecar_name(path)
    near = _any_output(path) if is_sidecar else path
    # of NAME.preview.jpg the sidecar is that of NAME
    if not sidecar_path(near).is_file() and near.stem.endswith(".preview"):
        near = near.with_name(near.stem.removesuffix(".preview") + near.suffix)
    file = sidecar_path(near)
    if not file.is_file():
        return ViewedResult(
            path=path,
            record=None,
            notes=(f"{file.name} does not lie beside it: only the picture is known",),
        )
    return _believed_result(path, read_record(file), is_sidecar=is_sidecar)


def is_there(path: Path) -> bool:
    """Return whether a file that a sidecar names is there, for this user."""
    try:
        return path.is_file()
    except OSError:
        return False


def is_sidecar_name(path: Path) -> bool:
    """Return whether a file has the name of a sidecar."""
    return path.name.endswith(SIDECAR_SUFFIX)


def read_record(sidecar: Path) -> dict[str, Any]:
    """Read a sidecar, given by its own path.

    Raises:
        DecodeError: If it is not there, or cannot be read as a sidecar.
    """
    if not sidecar.is_file():
        raise DecodeError(f"cannot read {sidecar}: there is no such file")
    record = read_sidecar(_any_output(sidecar))
    if record is None:
        raise DecodeError(f"{sidecar} is damaged, or not a sidecar of this version of camkit")
    if (fault := record_fault(record)) is not None:
        raise DecodeError(f"{sidecar} was edited: {fault}")
    return record


def _any_output(sidecar: Path) -> Path:
    return sidecar.with_name(sidecar.name.removesuffix(SIDECAR_SUFFIX) + ".any")


def _believed_result(path: Path, record: dict[str, Any], *, is_sidecar: bool) -> ViewedResult:
    main = path.with_name(Path(str(record["output"])).name)
    extra = record.get("beside")
    names = {Path(str(one)).name for one in extra} if isinstance(extra, list) else set()
    if not is_sidecar and path.name not in {main.name, *names}:
        note = f"the sidecar beside it names {main.name}, not this file"
        return ViewedResult(path=path, record=record, notes=(note,))
    if not is_there(main):
        raise DecodeError(f"cannot read {main}, which its sidecar names: there is no such file")
    changed = record["output_sha256"] != file_sha256(main)
    note = "the file was changed after it was made: its hash is not that of the sidecar"
    return ViewedResult(path=main, record=record, notes=(note,) * changed)

"""Results of `camkit process`, found by their files, their sidecars or their folders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from camkit.errors import DecodeError
from camkit.runtime.files.in_memory import FilePath
from camkit.runtime.output.sidecar import SIDECAR_SUFFIX, read_sidecar, sidecar_path
from camkit.runtime.raw import file_sha256

ARCHIVE_SUFFIX: Final = ".npz"
_TYPES: Final = {"seconds": dict, "plan": dict, "options": dict, "warnings": list, "output": str}
"""Of what a page reads in a sidecar."""


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
    is_sidecar = path.name.endswith(SIDECAR_SUFFIX)
    # of NAME.preview.jpg the sidecar is that of NAME
    name = path.name.removesuffix(SIDECAR_SUFFIX) + ".any" if is_sidecar else path.name
    near = path.with_name(name)
    if not sidecar_path(near).is_file() and near.stem.endswith(".preview"):
        near = near.with_name(near.stem.removesuffix(".preview") + near.suffix)
    file = sidecar_path(near)
    if not file.is_file():
        return ViewedResult(
            path=path,
            record=None,
            notes=(f"{file.name} does not lie beside it: only the picture is known",),
        )
    record = read_sidecar(near)
    if record is None or any(not isinstance(record.get(k), v) for k, v in _TYPES.items()):
        raise DecodeError(f"{file} is damaged, or not a sidecar of this version of camkit")
    return _believed_result(path, record, is_sidecar=is_sidecar)


def _believed_result(path: Path, record: dict[str, Any], *, is_sidecar: bool) -> ViewedResult:
    main = path.with_name(Path(str(record["output"])).name)
    extra = record.get("beside")
    names = {Path(str(one)).name for one in extra} if isinstance(extra, list) else set()
    if not is_sidecar and path.name not in {main.name, *names}:
        note = f"the sidecar beside it names {main.name}, not this file"
        return ViewedResult(path=path, record=record, notes=(note,))
    if not main.is_file():
        raise DecodeError(f"cannot read {main}, which its sidecar names: there is no such file")
    changed = record["output_sha256"] != file_sha256(main)
    note = "the file was changed after it was made: its hash is not that of the sidecar"
    return ViewedResult(path=main, record=record, notes=(note,) * changed)

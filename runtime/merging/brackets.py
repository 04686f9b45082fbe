"""Brackets and their frames: the files that are named, or those in a folder each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.batch.sources import CAPTURE_SUFFIXES, is_result
from camkit.runtime.merging.times import stated_times
from camkit.runtime.output.preview_file import PREVIEW_SUFFIX

FRAME_SUFFIXES: Final = CAPTURE_SUFFIXES | {".jpg", ".jpeg", ".hdr"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bracket:
    """The frames of one scene.

    Attributes:
        files: In the order given; those of a folder by name.
        folder: Where they lie; None for files that were named.
    """

    files: tuple[Path, ...]
    folder: Path | None = None

    def times_s(self, text: str | None) -> tuple[float, ...] | None:
        """Return the exposure time of every file; None for what the files state.

        Args:
            text: As `stated_times` takes it; a list may also lie in the folder.

        Raises:
            ContractError: If a time is missing, is stated twice, or is no time.
            DecodeError: If the list cannot be read.
        """
        if text is None:
            return None
        if self.folder is not None and not Path(text).is_file() and (self.folder / text).is_file():
            text = str(self.folder / text)
        return stated_times(text, self.files)


def find_brackets(paths: Sequence[Path]) -> list[Bracket]:
    """Return the brackets among paths: files are one, each folder of frames is one.

    A folder without frames stands for the folders of frames directly in it.

    Raises:
        ContractError: If files and folders are mixed, or a folder holds no frames.
        DecodeError: If a path is not there.
    """
    if absent := [path for path in paths if not path.exists()]:
        raise DecodeError(f"there is no file or folder {absent[0]}")
    folders = [path for path in paths if path.is_dir()]
    if not folders:
        return [Bracket(files=tuple(paths))]
    if len(folders) < len(paths):
        other = next(path for path in paths if path not in folders)
        raise ContractError(
            f"expected the files of one bracket, or folders that hold one each; got the folder "
            f"{folders[0]} and the file {other}"
        )
    return [bracket for folder in folders for bracket in _brackets_in(folder)]


def merged_paths(brackets: Sequence[Bracket], out: Path) -> list[Path]:
    """Return the EXR of every bracket.

    Args:
        brackets: What is merged.
        out: An EXR for a single bracket; else, or where it is a folder, the folder of EXRs that
            are named after those of the brackets.

    Raises:
        ContractError: If one EXR is named for several brackets, two would have one name, or the
            name is of another format.
    """
    if len(brackets) == 1 and (brackets[0].folder is None or not out.is_dir()):
        if out.suffix.lower() != ".exr":
            raise ContractError(f"a merged picture is an EXR; expected a name in .exr, got {out}")
        return [out]
    if out.suffix.lower() == ".exr":
        raise ContractError(
            f"{len(brackets)} brackets need a folder for their pictures as {option_text('out')}; "
            f"got {out}"
        )
    paths = [out / f"{bracket.folder.resolve().name}.exr" for bracket in brackets if bracket.folder]
    for path in paths:
        if paths.count(path) > 1:
            raise ContractError(
                f"two brackets would both give {path}; merge them into different folders"
            )
    return paths


def _brackets_in(folder: Path) -> list[Bracket]:
    if files := _frames_in(folder):
        return [Bracket(files=files, folder=folder)]
    inner = [path for path in sorted(folder.iterdir()) if path.is_dir()]
    brackets = [Bracket(files=files, folder=path) for path in inner if (files := _frames_in(path))]
    if not brackets:
        raise ContractError(
            f"{folder} holds no frames; expected RAW files or pictures ("
            f"{', '.join(sorted(FRAME_SUFFIXES))}), or folders of them"
        )
    return brackets


def _frames_in(folder: Path) -> tuple[Path, ...]:
    return tuple(
        path
        for path in sorted(folder.iterdir())
        if path.suffix.lower() in FRAME_SUFFIXES
        and not path.name.endswith(PREVIEW_SUFFIX)
        and path.is_file()
        and not is_result(path)
    )

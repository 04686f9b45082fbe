"""A folder that a command of `camkit calibrate` fills: all of it or nothing."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class Folder:
    """A folder to be filled; made by `checked`, before any work.

    Attributes:
        path: The folder.
        owned_parts: Folders of it that hold nothing but what is written, "." for itself.
        overwrite: Whether what is there may be replaced.
    """

    path: Path
    owned_parts: tuple[str, ...]
    overwrite: bool

    @classmethod
    def checked(
        cls, path: Path, marks: Sequence[str], owned_parts: Sequence[str], *, overwrite: bool
    ) -> Self:
        """Check the folder that a caller asks for.

        Args:
            path: The folder.
            marks: Files that a former run of the command leaves: with none of them, what is in
                the folder is somebody else's.
            owned_parts: Its parts that must hold nothing else.
            overwrite: Whether files that are there may be replaced.

        Raises:
            ContractError: If it is no folder, or holds something that may not be replaced.
        """
        if path.exists() and not path.is_dir():
            raise ContractError(f"{path} is a file; expected a folder")
        if path.is_dir() and any(path.iterdir()):
            if not overwrite:
                raise ContractError(
                    f"{path} is not empty; add --overwrite or choose another folder"
                )
            if not any((path / mark).exists() for mark in marks):
                raise ContractError(
                    f"{path} holds files of another kind, without {marks[0]}; give another folder"
                )
        return cls(path=path, owned_parts=tuple(owned_parts), overwrite=overwrite)

    @contextmanager
    def writing(self, names: Sequence[str]) -> Iterator[tuple[Path, ...]]:
        """Yield the paths to write to; files appear when the block ends well, all or none.

        Args:
            names: Paths in the folder; an absolute one may lie elsewhere.

        Raises:
            ContractError: If a part of the folder holds pictures or lists of other names, which
                would be mixed up with these.
        """
        from camkit.runtime.output.part_file import atomic_outputs

        paths = [self.path / name for name in names]
        for part in self.owned_parts:
            here = self.path / part
            if not here.is_dir():
                continue
            for path in sorted(here.iterdir()):
                if path.is_file() and path not in paths:
                    raise ContractError(
                        f"{path} is none of the files to be written; remove it or give another "
                        "folder"
                    )
        folders = _missing(paths)
        try:
            for folder in folders:
                folder.mkdir(exist_ok=True)
            with atomic_outputs(*paths) as parts:
                yield parts
        except BaseException:
            for folder in reversed(folders):
                if folder.is_dir() and not any(folder.iterdir()):
                    folder.rmdir()
            raise


def _missing(paths: Sequence[Path]) -> list[Path]:
    """Return the folders to be made, outer ones first."""
    missing = {folder for path in paths for folder in path.parents if not folder.exists()}
    return sorted(missing, key=lambda folder: len(folder.parts))

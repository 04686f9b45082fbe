"""Captures that are no files: bytes, and objects that are read like a file opened in binary mode.

LibRaw decodes in a child and large pictures are mapped, both by path, so the bytes are stored in a
temporary file for as long as they are read.
"""

import io
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, TypeGuard

from camkit.errors import ContractError
from camkit.runtime.files.tiff_tags import TiffTags, read_tiff_tags

FilePath = str | os.PathLike[str]
Source = FilePath | bytes | bytearray | memoryview | IO[bytes]

_MAGIC_SUFFIXES: Final = (
    (b"\x89PNG", ".png"),
    (b"\x76\x2f\x31\x01", ".exr"),
    (b"\xff\xd8", ".jpg"),
    (b"#?", ".hdr"),
)
_TIFF_STARTS: Final = (b"II*\0", b"II+\0", b"MM\0*", b"MM\0+")
_PHOTOMETRIC, _MAKE, _SUB_IFDS, _DNG_VERSION = 262, 271, 330, 50706
_SENSOR_PHOTOMETRICS: Final = (32803, 34892)


def optional_path(path: FilePath | None) -> Path | None:
    """Return a path; None for none."""
    return None if path is None else Path(path)


def is_path(source: Any) -> TypeGuard[FilePath]:
    """Return whether a source is a path, not data."""
    return isinstance(source, str | os.PathLike)


@contextmanager
def stored(source: Source) -> Iterator[Path]:
    """Yield a path that holds a capture: its own, or a temporary one for data in memory.

    Args:
        source: A path; bytes; or an object opened in binary mode, read from where it stands.

    Raises:
        ContractError: If it is none of these.
        OSError: If the data cannot be read or stored.
    """
    if is_path(source):
        yield Path(source)
        return
    if not isinstance(source, bytes | bytearray | memoryview) and not hasattr(source, "read"):
        raise ContractError(
            f"expected a path, bytes or a file opened in binary mode; got {type(source).__name__}"
        )
    if getattr(source, "closed", False):
        raise ContractError("the file is closed; open it in binary mode and keep it open")
    with tempfile.TemporaryDirectory(prefix="camkit-") as folder:
        path = Path(folder) / "data"
        with path.open("wb") as file:
            _copy(source, file)
        yield path.rename(path.with_name(_file_name(source, path)))


def list_paths(files: Any) -> Sequence[FilePath]:
    """Return one path or several as a list.

    Raises:
        ContractError: If any is data in memory, after which no picture can be named.
    """
    alone = is_path(files) or isinstance(files, bytes | bytearray) or hasattr(files, "read")
    if not alone and not isinstance(files, Iterable):
        raise ContractError(f"expected paths of captures; got {type(files).__name__}")
    paths = [files] if alone else list(files)
    for item in paths:
        if not is_path(item):
            raise ContractError(
                f"pictures are named after their files; got {type(item).__name__}: give paths, or "
                "hand data in memory to Pipeline.process"
            )
    return paths


def _copy(source: Any, file: IO[bytes]) -> None:
    if isinstance(source, bytes | bytearray | memoryview):
        file.write(source)
        return
    if isinstance(source, io.TextIOBase):
        raise ContractError("the file is opened as text; open it in binary mode ('rb')")
    shutil.copyfileobj(source, file)


def _file_name(source: Any, path: Path) -> str:
    """Return a name whose suffix tells pictures from RAW files: the object's own, if it has one."""
    name = getattr(source, "name", None)
    if isinstance(name, str) and Path(name).suffix:
        return Path(name).name
    with path.open("rb") as file:
        head = file.read(4)
    suffixes = [suffix for magic, suffix in _MAGIC_SUFFIXES if head.startswith(magic)]
    if not suffixes and head in _TIFF_STARTS and _is_plain(read_tiff_tags(path)):
        suffixes = [".tif"]
    return "data in memory" + (suffixes[0] if suffixes else ".raw")


def _is_plain(tags: TiffTags) -> bool:
    """Return whether a TIFF is plain, no RAW file that is built like one."""
    return not any(
        directory.get(_PHOTOMETRIC, (0,))[0] in _SENSOR_PHOTOMETRICS
        or any(tag in directory for tag in (_MAKE, _SUB_IFDS, _DNG_VERSION))
        for directory in tags.directories
    )

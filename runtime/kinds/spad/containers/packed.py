"""Members of a zip as bytes that can be sliced: mapped, in memory, or in a file without a name."""

import mmap
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

from camkit.errors import CamkitError, DecodeError
from camkit.regular_file import check_regular
from camkit.runtime.cancel import check_wish

MOST_UNPACKED: Final = 4_000_000_000
"""Bytes of one member."""
MOST_MEMBERS: Final = 10_000
PIECE: Final = 1 << 20
LOCAL_HEADER: Final = 30
BROKEN: Final = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    OSError,
    ValueError,
    NotImplementedError,
    RuntimeError,
    struct.error,
)
"""What zipfile raises of files that are damaged, encrypted or packed in other ways."""


@contextmanager
def opened_zip(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip; errors in it inside the block become a `DecodeError`."""
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive:
            if len(archive.infolist()) > MOST_MEMBERS:
                raise DecodeError(f"{path.name} holds more than {MOST_MEMBERS} files")
            yield archive
    except CamkitError:
        raise
    except BROKEN as error:
        raise DecodeError(f"{path.name} is damaged, or no zip: {error}") from error


def member_bytes(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, max_bytes: int
) -> memoryview | mmap.mmap:
    """Return the bytes of a member.

    Args:
        archive: Open.
        member: Which.
        max_bytes: What may be held in memory; more lies in a file.

    Raises:
        DecodeError: If it unpacks to more than a capture has.
    """
    if member.file_size > MOST_UNPACKED:
        raise DecodeError(
            f"{member.filename} unpacks to {member.file_size / 1e9:.1f} GB, more than "
            f"{MOST_UNPACKED / 1e9:.0f} GB are unpacked; store it as it is, or as HDF5"
        )
    if member.file_size == 0:
        raise DecodeError(f"{member.filename} is empty")
    if member.compress_type == zipfile.ZIP_STORED and archive.filename is not None:
        return memoryview(_mapped(Path(archive.filename), member))[_at(archive, member) :]
    with archive.open(member) as packed:
        if member.file_size <= max_bytes:
            return memoryview(b"".join(_pieces(packed)))
        with tempfile.TemporaryFile() as file:
            return _spilled(packed, file)


def _mapped(path: Path, member: zipfile.ZipInfo) -> mmap.mmap:
    with path.open("rb") as file:
        data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    end = member.header_offset + LOCAL_HEADER + member.file_size
    if end > len(data):
        raise DecodeError(
            f"{path.name} is cut off: {member.filename} ends at byte {end} or later, the file has "
            f"{len(data)}"
        )
    return data


def _at(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> int:
    """Return where the bytes of a stored member begin (APPNOTE 4.3.7)."""
    with Path(str(archive.filename)).open("rb") as file:
        file.seek(member.header_offset)
        header = file.read(LOCAL_HEADER)
    name, extra = struct.unpack("<HH", header[26:30])
    return int(member.header_offset + LOCAL_HEADER + name + extra)


def _pieces(packed: IO[bytes]) -> Iterator[bytes]:
    while piece := packed.read(PIECE):
        check_wish()
        yield piece


def _spilled(packed: IO[bytes], file: IO[bytes]) -> mmap.mmap:
    for piece in _pieces(packed):
        file.write(piece)
    file.flush()
    return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

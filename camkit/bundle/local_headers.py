"""A zip says everything about a member twice: in its directory, and in front of the data.

    local header, data [, descriptor] | ... | directory | end record

Readers that stream believe the first, readers that seek the second. Here both must say the same,
the members must lie one behind the other without gap or overlap, and nothing may follow the end
record: every reader then sees the same members.

References: PKWARE APPNOTE 6.3.10, 4.3.6 to 4.3.16.
"""

import struct
import zipfile
from collections.abc import Sequence
from typing import Final

from camkit.errors import BundleError

_LOCAL: Final = struct.Struct("<4s5H3L2H")
_LOCAL_MAGIC: Final = b"PK\x03\x04"
_DESCRIPTOR_MAGIC: Final = b"PK\x07\x08"
_FACTS: Final = struct.Struct("<3L")
_END: Final = struct.Struct("<4s4H2LH")
_END_MAGIC: Final = b"PK\x05\x06"
_SIZES_FOLLOW: Final = 0x8
_ADVICE: Final = "pack the bundle again"


def check_local_headers(data: bytes, archive: zipfile.ZipFile) -> None:
    """Check the headers in front of the members against the directory.

    Args:
        data: The whole file.
        archive: The same, its directory read.

    Raises:
        BundleError: If one says something else, or there are bytes that belong to no member.
    """
    expected = 0
    for entry in sorted(archive.infolist(), key=lambda entry: entry.header_offset):
        if entry.header_offset != expected:
            raise BundleError(
                f"member {entry.filename} begins at byte {entry.header_offset}, what lies before "
                f"it ends at {expected}: members overlap, or bytes belong to none; {_ADVICE}"
            )
        expected = _end_of(data, entry)
    _check_end(data, archive, expected)


def _end_of(data: bytes, entry: zipfile.ZipInfo) -> int:
    """Check the local header of a member; return the position behind its data."""
    at = entry.header_offset
    if len(data) < at + _LOCAL.size:
        raise BundleError(f"member {entry.filename} has no local header; {_ADVICE}")
    magic, _, flags, method, _, _, crc, packed, size, name_bytes, extra_bytes = _LOCAL.unpack_from(
        data, at
    )
    begin = at + _LOCAL.size
    name = data[begin : begin + name_bytes]
    facts = (entry.CRC, entry.compress_size, entry.file_size)
    follow = bool(entry.flag_bits & _SIZES_FOLLOW)
    same = (magic, name, flags, method) == (
        *(_LOCAL_MAGIC, entry.orig_filename.encode("utf-8")),
        *(entry.flag_bits, entry.compress_type),
    )
    if not same or not ((crc, packed, size) == facts or (follow and not (crc or packed or size))):
        raise BundleError(
            f"the local header of member {entry.filename} contradicts the directory of the zip; "
            f"{_ADVICE}"
        )
    end = begin + name_bytes + extra_bytes + entry.compress_size
    return _behind_descriptor(data, end, entry) if follow else end


def _behind_descriptor(data: bytes, end: int, entry: zipfile.ZipInfo) -> int:
    """Check the facts that follow the data of a member; return the position behind them."""
    begin = end + len(_DESCRIPTOR_MAGIC) * (data[end : end + 4] == _DESCRIPTOR_MAGIC)
    facts = data[begin : begin + _FACTS.size]
    if facts != _FACTS.pack(entry.CRC, entry.compress_size, entry.file_size):
        raise BundleError(
            f"what follows the data of member {entry.filename} contradicts the directory of the "
            f"zip; {_ADVICE}"
        )
    return begin + _FACTS.size


def _check_end(data: bytes, archive: zipfile.ZipFile, members_end: int) -> None:
    """Refuse bytes between members, directory, end record and the end of the file."""
    at = len(data) - _END.size - len(archive.comment)
    if at < 0 or data[at : at + 4] != _END_MAGIC:
        raise BundleError(f"bytes follow the end record of the zip; {_ADVICE}")
    _, disk, first_disk, here, count, size, offset, comment_bytes = _END.unpack_from(data, at)
    entries: Sequence[zipfile.ZipInfo] = archive.infolist()
    if (disk, first_disk, here, count) != (0, 0, len(entries), len(entries)) or (
        (offset, offset + size, comment_bytes) != (members_end, at, len(archive.comment))
    ):
        raise BundleError(
            f"the end record of the zip contradicts its directory of {len(entries)} members; "
            f"{_ADVICE}"
        )

"""The zip around a bundle: read in memory, never extracted, nothing in it trusted.

What is refused here, each with its own message: no zip, encryption, unknown compression, too many
members, `..`, absolute, drive, backslash and other odd names, duplicate names, links and other
special files, a compression ratio above 100, more bytes than the cap, damaged data, and headers in
front of the members that contradict the directory (local_headers.py). The sizes in the zip's
headers are used to refuse early, never to allocate: reading stops at the cap.
"""

import hashlib
import io
import re
import stat
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from camkit.bundle.local_headers import check_local_headers
from camkit.errors import BundleError, DecodeError
from camkit.regular_file import check_regular

MAX_BUNDLE_BYTES: Final = 128 * 2**20
"""Cap on the sum of the uncompressed members (and on the file itself): kernels of 7 fields and 3
wavelengths, 901 px a side, are 68 MB."""
NETWORKS: Final = (".onnx", ".pth", ".pt")
"""Ends of names of files that hold a network."""
MAX_MEMBERS: Final = 64
MAX_RATIO: Final = 100

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
_ENTRY_MAGIC: Final = b"PK\x01\x02"
_ENCRYPTED: Final = 0x1 | 0x40
_CHUNK_BYTES: Final = 2**20
# What zipfile raises on damaged or hostile files, found by flipping bytes of valid ones.
_ZIP_ERRORS: Final = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """A zip in memory whose directory was checked.

    Attributes:
        data: The whole file.
        sha256: Its hash, in hexadecimal.
        sizes: Member -> uncompressed size as the directory states it.
        max_bytes: Cap on the uncompressed size of a member.
    """

    data: bytes = field(repr=False)
    sha256: str
    sizes: dict[str, int]
    max_bytes: int

    def read(self, name: str) -> bytes:
        """Decompress one member, at most `max_bytes` of it.

        Raises:
            BundleError: If there is no such member, or it is damaged or too large.
        """
        if name not in self.sizes:
            raise BundleError(f"the bundle has no member {name!r}; it has {', '.join(self.sizes)}")
        try:
            with zipfile.ZipFile(io.BytesIO(self.data)) as archive:
                return self._read_capped(archive, name)
        except _ZIP_ERRORS as error:
            raise BundleError(
                f"member {name} is damaged ({error}); fetch the bundle again"
            ) from error

    def _read_capped(self, archive: zipfile.ZipFile, name: str) -> bytes:
        info = archive.getinfo(name)
        cap = min(self.max_bytes, MAX_RATIO * max(info.compress_size, 1))
        chunks, total = [], 0
        with archive.open(info) as stream:
            while chunk := stream.read(_CHUNK_BYTES):
                total += len(chunk)
                if total > cap:
                    raise BundleError(f"member {name} unpacks to more than {cap} bytes; refused")
                chunks.append(chunk)
        if total != info.file_size:
            raise BundleError(
                f"member {name} unpacks to {total} bytes; the zip says {info.file_size}"
            )
        return b"".join(chunks)


def read_container(path: Path, *, max_bytes: int = MAX_BUNDLE_BYTES) -> Container:
    """Read a zip into memory and check its directory.

    Args:
        path: The file.
        max_bytes: Cap on the file, and on the sum of its uncompressed members.

    Raises:
        BundleError: See the list at the top of the module.
    """
    try:
        check_regular(Path(path))
        with Path(path).open("rb") as stream:
            data = stream.read(max_bytes + 1)
    except OSError as error:
        raise BundleError(f"cannot read the bundle {path}: {error.strerror}") from error
    except DecodeError as error:
        raise BundleError(f"cannot read the bundle {path}: {error}") from error
    if str(path).endswith(NETWORKS) and b"manifest.json" not in data:
        raise BundleError(
            f"{path} is a network, not a bundle; it goes into one by `camkit network add`"
        )
    return container_from_bytes(data, what=str(path), max_bytes=max_bytes)


def container_from_bytes(data: bytes, *, what: str, max_bytes: int = MAX_BUNDLE_BYTES) -> Container:
    """Check the directory of a zip in memory; see `read_container`."""
    if len(data) > max_bytes:
        raise BundleError(f"{what} is larger than the cap of {max_bytes} bytes; refused")
    if not data.startswith(b"PK\x03\x04"):
        raise BundleError(f"{what} is not a zip, so not a bundle; expected a .camkit file")
    # Counted before zipfile makes an object of each entry; a few more may occur by chance in
    # compressed data.
    if data.count(_ENTRY_MAGIC) > 2 * MAX_MEMBERS:
        raise BundleError(f"{what} has too many members; a bundle has at most {MAX_MEMBERS}")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
            _check_entries(entries, max_bytes)
            check_local_headers(data, archive)
    except _ZIP_ERRORS as error:
        raise BundleError(f"{what} is a damaged zip ({error}); fetch the bundle again") from error
    return Container(
        data=data,
        sha256=hashlib.sha256(data).hexdigest(),
        sizes={entry.filename: entry.file_size for entry in entries},
        max_bytes=max_bytes,
    )


def _check_entries(entries: list[zipfile.ZipInfo], max_bytes: int) -> None:
    if not entries:
        raise BundleError("the zip is empty, so it is not a bundle; fetch the bundle again")
    if len(entries) > MAX_MEMBERS:
        raise BundleError(
            f"the bundle has too many members: {len(entries)}; at most {MAX_MEMBERS} are read"
        )
    for entry in entries:
        check_name(entry.orig_filename)
        _check_entry(entry)
    name, count = Counter(entry.filename for entry in entries).most_common(1)[0]
    if count > 1:
        raise BundleError(f"the bundle has {count} members named {name!r}; names must be unique")
    total = sum(entry.file_size for entry in entries)
    if total > max_bytes:
        raise BundleError(f"the bundle unpacks to {total} bytes; the cap is {max_bytes}")


def check_name(name: str) -> None:
    """Refuse a member name that is not a plain file name.

    Raises:
        BundleError: Naming what is wrong: backslash, drive, absolute, `..`, folder, or other.
    """
    if "\\" in name:
        raise BundleError(f"member name {name!r} has a backslash; refused")
    if re.match(r"[A-Za-z]:", name):
        raise BundleError(f"member name {name!r} has a drive letter; refused")
    if name.startswith("/"):
        raise BundleError(f"member name {name!r} is absolute; refused")
    if ".." in name.split("/"):
        raise BundleError(f"member name {name!r} leads out of the bundle (..); refused")
    if "/" in name:
        raise BundleError(f"member name {name!r} has a folder; a bundle is flat")
    if not _NAME.fullmatch(name):
        raise BundleError(
            f"member name {name[:120]!r} is not plain letters, digits, '_.-'; refused"
        )


def _check_entry(entry: zipfile.ZipInfo) -> None:
    name = entry.filename
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind == stat.S_IFLNK:
        raise BundleError(f"member {name} is a symbolic link; refused")
    if kind not in (0, stat.S_IFREG):
        raise BundleError(f"member {name} is a special file (mode {kind:o}); refused")
    if entry.flag_bits & _ENCRYPTED:
        raise BundleError(f"member {name} is encrypted; a bundle is open to its reader")
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise BundleError(
            f"member {name} has compression {entry.compress_type}; only stored and deflate are read"
        )
    if entry.file_size > MAX_RATIO * max(entry.compress_size, 1):
        raise BundleError(
            f"member {name} is compressed {entry.file_size}:{entry.compress_size}; "
            f"a ratio above {MAX_RATIO} is refused"
        )

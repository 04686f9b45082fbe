"""Whoever reads a bundle, from its directory or as a stream, sees the same members."""

import io
import struct
import zipfile
from pathlib import Path

import pytest

from camkit.bundle.container import container_from_bytes
from camkit.errors import BundleError

NAMES = ("first.txt", "second.txt")


def _zip(*, streamed: bool = False, comment: bytes = b"") -> bytes:
    class Stream(io.BytesIO):
        def seek(self, *_: int) -> int:
            raise io.UnsupportedOperation("a stream")

    buffer = Stream() if streamed else io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in NAMES:
            archive.writestr(name, name.encode() * 20)
        archive.comment = comment
    return buffer.getvalue()


def _changed(data: bytes, at: int, value: bytes) -> bytes:
    return data[:at] + value + data[at + len(value) :]


def _refuse(data: bytes, message: str) -> None:
    with pytest.raises(BundleError, match=message):
        container_from_bytes(data, what="hostile.camkit")


@pytest.mark.parametrize("comment", [b"", b"made by a test"])
@pytest.mark.parametrize("streamed", [False, True])
def test_plain_and_streamed_zips_are_read(streamed: bool, comment: bytes) -> None:
    data = _zip(streamed=streamed, comment=comment)
    container = container_from_bytes(data, what="sound.camkit")
    assert [container.read(name) for name in NAMES] == [name.encode() * 20 for name in NAMES]


@pytest.mark.parametrize(
    ("at", "value"),
    [
        (6, b"\x00\x08"),  # flags
        (8, b"\x00\x00"),  # method
        (14, b"\x01\x02\x03\x04"),  # checksum
        (18, b"\x01\x00\x00\x00"),  # packed size
        (22, b"\xff\x00\x00\x00"),  # size
        (30, b"F"),  # name
    ],
)
def test_a_local_header_that_contradicts_the_directory_is_refused(at: int, value: bytes) -> None:
    _refuse(_changed(_zip(), at, value), "local header of member first.txt contradicts")


def test_a_descriptor_that_contradicts_the_directory_is_refused() -> None:
    data = _zip(streamed=True)
    at = data.find(b"PK\x07\x08")
    _refuse(_changed(data, at + 4, b"\x00\x00\x00\x00"), "follows the data of member first.txt")


def test_members_that_share_their_data_are_refused() -> None:
    data = _zip()
    directory = data.rfind(b"PK\x01\x02")
    _refuse(_changed(data, directory + 42, b"\x00\x00\x00\x00"), "members overlap")


def test_a_member_that_the_directory_hides_is_refused() -> None:
    data = _zip()
    second = data.find(b"PK\x03\x04", 4)
    hidden = data[:second]
    directory, end = data.find(b"PK\x01\x02"), data.find(b"PK\x05\x06")
    size, offset = struct.unpack_from("<2L", data, end + 12)
    moved = bytearray(hidden + data)
    for entry in (directory, data.rfind(b"PK\x01\x02")):
        place = struct.unpack_from("<L", data, entry + 42)[0] + len(hidden)
        struct.pack_into("<L", moved, len(hidden) + entry + 42, place)
    struct.pack_into("<2L", moved, len(hidden) + end + 12, size, offset + len(hidden))
    _refuse(bytes(moved), "bytes belong to none")


def test_what_follows_the_end_is_refused() -> None:
    _refuse(_zip() + b"more", "bytes follow the end record")


@pytest.mark.parametrize(("field", "value"), [(8, 1), (10, 3), (4, 1), (20, 4)])
def test_an_end_record_that_contradicts_the_directory_is_refused(field: int, value: int) -> None:
    data = _zip()
    end = data.find(b"PK\x05\x06")
    _refuse(_changed(data, end + field, struct.pack("<H", value)), "end record of the zip")


def test_a_zip_behind_something_else_is_refused() -> None:
    _refuse(_zip() + _zip(), "members overlap, or bytes belong to none")


def test_an_empty_directory_is_refused() -> None:
    with pytest.raises(BundleError, match="the zip is empty"):
        container_from_bytes(
            b"PK\x03\x04" + b"PK\x05\x06" + bytes(18), what=str(Path("empty.camkit"))
        )

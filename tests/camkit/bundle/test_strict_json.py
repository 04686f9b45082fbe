"""JSON is read only if every reader would take it alike."""

import struct

import pytest

from camkit.bundle.manifest import read_manifest
from camkit.bundle.psf_file import read_tensors
from camkit.bundle.strict_json import read_json
from camkit.errors import BundleError


def test_sound_json_is_given_as_it_is() -> None:
    text = '{"a": {"b": [1, 2.5, null]}, "b": "é"}'
    assert read_json(text.encode(), what="x") == {"a": {"b": [1, 2.5, None]}, "b": "é"}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'{"a": 1, "a": 1}', "holds the key 'a' twice"),
        (b'{"x": [{"a": 1, "b": 2, "a": 3}]}', "holds the key 'a' twice"),
        (rb'{"a": 1, "\u0061": 2}', "holds the key 'a' twice"),
        (b"[" * 100_000, "nested too deep"),
        (b'{"a": ' * 100_000, "nested too deep"),
        (b'{"a": ' + b"9" * 5000 + b"}", "cannot be read"),
        (b"\xff", "cannot be read"),
    ],
)
def test_json_that_readers_take_differently_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(BundleError, match=f"the list.*{message}"):
        read_json(data, what="the list")


def test_a_manifest_with_a_key_twice_is_refused() -> None:
    with pytest.raises(BundleError, match=r"manifest\.json holds the key 'name' twice"):
        read_manifest(b'{"format_version": "2.0", "name": "a", "name": "b"}')


def _tensors(header: bytes, stated: int | None = None) -> bytes:
    size = len(header) if stated is None else stated
    return struct.pack("<Q", size) + header + struct.pack("<f", 1.0)


def test_a_tensor_stated_twice_is_refused() -> None:
    entry = b'"a": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}'
    assert read_tensors(_tensors(b"{" + entry + b"}"), what="x")["a"] == 1
    with pytest.raises(BundleError, match="the header of x holds the key 'a' twice"):
        read_tensors(_tensors(b"{" + entry + b"," + entry + b"}"), what="x")


@pytest.mark.parametrize("stated", [2**63, 2**21, 40])
def test_a_header_longer_than_the_file_is_refused(stated: int) -> None:
    with pytest.raises(BundleError, match=f"said to have {stated} bytes"):
        read_tensors(_tensors(b"{}", stated), what="x")

"""Text of files that other programs wrote: UTF-16, UTF-8 or latin-1, mostly unmarked."""

import codecs
from pathlib import Path
from typing import Final

from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_bytes

MAX_BYTES: Final = 8_000_000
"""Catalogues are below 2 MB and lens files below 1 MB."""


def read_text(path: Path) -> str:
    """Read a text file of unknown encoding.

    Raises:
        DecodeError: If it is larger than `MAX_BYTES` or is not text.
    """
    try:
        data = read_side_bytes(path, "the lens or glass file", most_bytes=MAX_BYTES)
    except ContractError as error:
        raise DecodeError(str(error)) from error
    return decode_text(data, path.name)


def decode_text(data: bytes, name: str) -> str:
    """Decode by byte order mark, else by where zero bytes lie, else as UTF-8, else as latin-1."""
    encoding = _encoding_of(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise DecodeError(
            f"{name} must be {encoding} text; it is damaged: {error.reason}"
        ) from error
    if "\0" in text:
        raise DecodeError(f"{name} must be a text file; it holds zero bytes (is it binary?)")
    return text


def _encoding_of(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    # plain text in UTF-16 has a zero in every other byte
    head = data[:400]
    zeros_even, zeros_odd = head[::2].count(0), head[1::2].count(0)
    if len(head) >= 2 and zeros_odd > 0.8 * (len(head) // 2) and zeros_even == 0:
        return "utf-16-le"
    if len(head) >= 2 and zeros_even > 0.8 * (len(head) // 2) and zeros_odd == 0:
        return "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"

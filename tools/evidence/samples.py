"""Hashes of arrays, and of the samples of files: dates and other headers do not count."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import tifffile
from numpy.typing import NDArray

DIGITS = 16


def array_hash(array: NDArray[Any]) -> str:
    """Return the start of the SHA-256 of type, shape and samples of an array."""
    return _hash(f"{array.dtype.str} {array.shape}".encode() + array.tobytes())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:DIGITS]


def file_samples(path: Path) -> dict[str, Any]:
    """Return what a file holds: name -> hash of an array; a sidecar as its JSON values."""
    suffix = path.suffix.lower()
    if suffix == ".json":
        return dict(json.loads(path.read_text(encoding="utf-8")))
    if suffix == ".npz":
        with np.load(path) as arrays:
            return {name: array_hash(arrays[name]) for name in sorted(arrays.files)}
    if suffix == ".exr":
        parts = OpenEXR.File(str(path), separate_channels=True).parts
        return {
            f"{number}.{name}": array_hash(channel.pixels)
            for number, part in enumerate(parts)
            for name, channel in sorted(part.channels.items())
        }
    if suffix in {".tif", ".tiff", ".dng"}:
        with tifffile.TiffFile(path) as file:
            return {f"page {n}": _page_hash(file, page) for n, page in enumerate(_pages(file))}
    if suffix in {".png", ".jpg"}:
        pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        return {"pixels": "unreadable" if pixels is None else array_hash(pixels)}
    if suffix == ".mp4":
        return {"frames": [array_hash(frame) for frame in _frames(path)]}
    return {"bytes": _hash(path.read_bytes())}


def _pages(file: tifffile.TiffFile) -> Iterator[tifffile.TiffPage]:
    """Yield the pages of a TIFF, each followed by those below it."""
    for page in file.pages:
        yield page
        yield from page.pages or ()


def _page_hash(file: tifffile.TiffFile, page: tifffile.TiffPage) -> str:
    """Return the hash of a page's samples, of lossless JPEG as they are coded."""
    if page.compression != tifffile.COMPRESSION.JPEG:
        return array_hash(page.asarray())
    segments = file.filehandle.read_segments(page.dataoffsets, page.databytecounts)
    return _hash(b"".join(segment for segment, _ in segments))


def _frames(path: Path) -> Iterator[NDArray[Any]]:
    film = cv2.VideoCapture(str(path))
    while True:
        is_there, frame = film.read()
        if not is_there:
            return
        yield frame

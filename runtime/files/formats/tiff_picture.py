"""The samples of a TIFF page.

plain RGB and grey of 8, 16 and 32 bits      OpenCV, which gives other kinds wrong in silence
planes, halves, doubles, alpha, MinIsWhite   tifffile, with imagecodecs where it is there
samples of 1 to 15 bits                      `packed_bits`
"""

import logging
import lzma
import struct
import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.files.formats import tiff_page
from camkit.runtime.files.formats.decoded import Decoded
from camkit.runtime.files.formats.mapped_tiff import map_plain_tiff
from camkit.runtime.files.formats.opencv_picture import (
    decode_array,
    decoded_samples,
    split_alpha,
)
from camkit.runtime.files.formats.packed_bits import Codec, read_packed
from camkit.runtime.files.formats.stated_space import space_of_tiff
from camkit.runtime.files.formats.tiff_meaning import is_lab, light_of_lab, to_grey_or_rgb
from camkit.runtime.files.formats.tiff_page import TiffPage, picture_page
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.geometry.turning import turn_back

# what it logs of odd files must not reach the terminal
logging.getLogger("tifffile").addHandler(logging.NullHandler())

EXTRA: Final = "pip install 'camkit[tiff]'"
_EXTRA_PACKAGE: Final = "imagecodecs"
_ORIENTATION: Final = 274
_OPAQUE: Final = 255
INSIDE_TIFFFILE: Final = (
    *(ValueError, TypeError, KeyError, IndexError, NotImplementedError, RuntimeError),
    *(
        struct.error,
        zlib.error,
        lzma.LZMAError,
        EOFError,
        ImportError,
        OverflowError,
        ZeroDivisionError,
        AttributeError,
    ),
)
"""Errors of tifffile and its codecs on files that are damaged or of a kind that they lack."""
_COMPRESSIONS: Final = {
    2: "CCITT RLE",
    3: "CCITT group 3",
    4: "CCITT group 4",
    5: "LZW",
    6: "JPEG (old style)",
    7: "JPEG",
    8: "Deflate",
    32773: "PackBits",
    32909: "PixarLog",
    32946: "Deflate",
    33003: "JPEG 2000",
    33004: "JPEG 2000",
    33005: "JPEG 2000",
    34712: "JPEG 2000",
    34887: "LERC",
    34892: "lossy JPEG",
    34925: "LZMA",
    34933: "PNG",
    34934: "JPEG XR",
    50000: "Zstandard",
    50001: "WebP",
    50002: "JPEG XL",
    22610: "JPEG XR",
    52546: "JPEG XL",
}
_UNREAD: Final = {
    32766: "NeXT RLE",
    32771: "CCITT RLE in words",
    32809: "ThunderScan",
    34661: "JBIG",
    34676: "SGILog",
    34677: "SGILog24",
}
_WITHOUT_EXTRA: Final = (
    tiff_page.PLAIN,
    tiff_page.DEFLATE,
    tiff_page.OLD_DEFLATE,
    tiff_page.PACK_BITS,
)
_OF_OPENCV: Final = (*_WITHOUT_EXTRA, tiff_page.LZW, tiff_page.JPEG, 2, 3, 4)


def decode_tiff(path: Path, tags: TiffTags) -> Decoded:
    """Decode the picture of a TIFF, as stored and not turned.

    Args:
        path: The file.
        tags: Of the file; their strips and tiles lie inside.

    Raises:
        DecodeError: If it is damaged, or of a kind that is not read; names it.
    """
    page, notes = picture_page(tags)
    statement = space_of_tiff(tags)
    mapped = map_plain_tiff(path) if page.number == 1 else None
    if mapped is not None:
        planes = mapped if mapped.ndim == 2 else np.moveaxis(mapped, -1, 0)
        return decoded_samples(planes, statement, notes)
    ready = _by_opencv(path, page)
    if ready is not None:
        more = ("alpha channel dropped",) if page.samples > page.colours else ()
        return decoded_samples(ready, statement, (*notes, *more))
    stored = _read(path, page)
    if is_lab(page):
        return Decoded(samples=light_of_lab(stored, page), top=0, notes=notes)
    samples, remarks = to_grey_or_rgb(stored, page)
    is_packed = page.kind != tiff_page.FLOAT and page.photometric != tiff_page.PALETTE
    top = (1 << page.bits) - 1 if is_packed else None
    return decoded_samples(samples, statement, (*notes, *remarks), top)


def _by_opencv(path: Path, page: TiffPage) -> NDArray[Any] | None:
    """Decode what OpenCV gives rightly: (h, w) or (3, h, w); None for all else.

    Raises:
        DecodeError: If the file is damaged.
    """
    if not _is_of_opencv(page):
        return None
    data = bytearray(path.read_bytes())
    order, is_big = ("<" if data[:2] == b"II" else ">"), data[2] + data[3] == 43
    # the page becomes the first one
    struct.pack_into(order + ("Q" if is_big else "I"), data, 8 if is_big else 4, page.start)
    try:
        samples, alpha = split_alpha(decode_array(data))
    except DecodeError:
        if page.compression in _WITHOUT_EXTRA:
            return None  # tifffile knows some that libtiff does not, and says what is wrong
        raise
    if alpha is not None and alpha.dtype == np.uint8 and int(alpha.min()) < _OPAQUE:
        return None  # libtiff has multiplied colours by it
    # OpenCV turns a TIFF upright, whatever it is asked for
    orientation = page.number_of(_ORIENTATION, 1)
    stored = turn_back(samples, orientation if orientation in range(1, 9) else 1)
    if stored.shape[-2:] != page.size_px[::-1]:
        raise DecodeError(f"expected {page.size_px} pixels; got shape {stored.shape}")
    return np.ascontiguousarray(stored)


def _is_of_opencv(page: TiffPage) -> bool:
    if page.is_planar or page.empty_chunks or page.samples == 2:
        return False
    if page.compression not in _OF_OPENCV:
        return False
    if page.photometric == tiff_page.MIN_IS_BLACK and page.colours == 3:
        return False
    plain = page.photometric in (tiff_page.MIN_IS_BLACK, tiff_page.RGB)
    if page.kind == tiff_page.FLOAT:
        return plain and page.bits == 32 and page.samples in (1, 3)
    if page.bits == 16:
        return plain
    if page.photometric in (tiff_page.MIN_IS_WHITE, tiff_page.PALETTE):
        # what needs no extra is read here; libtiff knows the other codecs
        return page.bits in (1, 8) and page.compression not in _WITHOUT_EXTRA
    if page.bits == 1:
        return plain and page.compression not in _WITHOUT_EXTRA
    return page.bits == 8 and (plain or page.photometric == tiff_page.YCBCR)


def _read(path: Path, page: TiffPage) -> NDArray[Any]:
    """Read (sample, h, w) as stored: unsigned integers, or float32."""
    if page.photometric == tiff_page.YCBCR:
        raise DecodeError("a YCbCr TIFF of this kind is not read; save it as RGB")
    if page.compression not in (tiff_page.PLAIN, *_COMPRESSIONS):
        name = _UNREAD.get(page.compression, f"compression {page.compression}")
        raise DecodeError(f"a TIFF packed by {name} is not read; save it without compression")
    try:
        samples = _read_by_tifffile(path, page)
    except INSIDE_TIFFFILE as error:
        if _EXTRA_PACKAGE in str(error) or isinstance(error, ImportError):
            name = _COMPRESSIONS.get(page.compression, f"compression {page.compression}")
            more = f" with predictor {page.predictor}" if page.predictor > 1 else ""
            raise DecodeError(
                f"a TIFF of this kind packed by {name}{more} needs {_EXTRA_PACKAGE}: {EXTRA}, or "
                "save it without compression"
            ) from error
        words = " ".join(str(error).split())[:160]
        raise DecodeError(f"the TIFF is damaged or of an unknown kind: {words}") from error
    return samples.astype(np.float32) if np.issubdtype(samples.dtype, np.floating) else samples


def _read_by_tifffile(path: Path, page: TiffPage) -> NDArray[Any]:
    import tifffile

    with tifffile.TiffFile(path) as file:
        file.filehandle.seek(page.start)
        file_page = tifffile.TiffPage(file, index=0)
        packed = page.kind != tiff_page.FLOAT and page.bits not in (8, 16)
        if packed:
            return read_packed(path, page, _codec(page))
        if page.compression in (tiff_page.DEFLATE, tiff_page.OLD_DEFLATE, tiff_page.LZMA):
            _check_inflated(file, file_page)
        samples = file_page.asarray(maxworkers=1)
        planes, depth, high, wide, each = file_page.shaped
        if depth != 1 or (wide, high) != page.size_px or planes * each != page.samples:
            raise DecodeError(f"expected {page.size_px} pixels; got shape {file_page.shaped}")
        shaped = samples.reshape(planes, high, wide, each)
        ordered = np.moveaxis(shaped, -1, 1).reshape(page.samples, high, wide)
        if ordered.dtype.kind == "i":  # a and b of Lab
            ordered = ordered.view(ordered.dtype.str.replace("i", "u"))
        return np.ascontiguousarray(ordered, dtype=ordered.dtype.newbyteorder("="))


def _codec(page: TiffPage) -> Codec | None:
    """Return the decoder of a compression that `packed_bits` has not."""
    import tifffile

    if page.compression in (tiff_page.PLAIN, tiff_page.DEFLATE, tiff_page.OLD_DEFLATE):
        return None
    codec: Codec = tifffile.TIFF.DECOMPRESSORS[page.compression]
    return codec


def _check_inflated(file: Any, page: Any) -> None:
    """Refuse strips or tiles that become larger than they may, before all of it is held."""
    most = int(np.prod(page.chunks, dtype=np.int64)) * page.dtype.itemsize
    for offset, length in zip(page.dataoffsets, page.databytecounts, strict=True):
        file.filehandle.seek(offset)
        data = file.filehandle.read(length)
        if page.compression == tiff_page.LZMA:
            unpack = lzma.LZMADecompressor()
            unpack.decompress(data, most)
            more = b"" if unpack.eof else unpack.decompress(b"", 1)
        else:
            inflate = zlib.decompressobj()
            inflate.decompress(data, most)
            more = inflate.decompress(inflate.unconsumed_tail, 1)
        if more:
            raise DecodeError(f"a strip or tile holds more than its {most} bytes: it is damaged")

"""Opens the writer of a product in a format."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, Literal

from camkit.bundle.golden import IMAGE
from camkit.errors import ContractError
from camkit.runtime.output.picture_writer import UPRIGHT, PictureFormat, PictureWriter

FileFormat = Literal["exr", "tiff", "png", "jpeg", "dng"]
SUFFIXES: Final[dict[FileFormat, str]] = {
    "exr": "exr",
    "tiff": "tif",
    "png": "png",
    "jpeg": "jpg",
    "dng": "dng",
}
Open = Callable[[Path, PictureFormat], PictureWriter]


def _exr(path: Path, picture: PictureFormat) -> PictureWriter:
    from camkit.runtime.output.exr import ExrWriter

    return ExrWriter(path, picture)


def _tiff(path: Path, picture: PictureFormat) -> PictureWriter:
    from camkit.runtime.output.tiff_writer import TiffWriter

    return TiffWriter(path, picture)


def _png(path: Path, picture: PictureFormat) -> PictureWriter:
    from camkit.runtime.output.png import PngWriter

    return PngWriter(path, picture)


def _jpeg(path: Path, picture: PictureFormat) -> PictureWriter:
    from camkit.runtime.output.jpeg import JpegWriter

    return JpegWriter(path, picture)


def _dng(path: Path, picture: PictureFormat) -> PictureWriter:
    from camkit.runtime.output.linear_dng import LinearDngWriter

    return LinearDngWriter(path, picture)


WRITERS: Final[dict[str, dict[str, Open]]] = {
    IMAGE: {"exr": _exr, "tiff": _tiff, "png": _png, "jpeg": _jpeg, "dng": _dng},
}
"""Product -> format -> what opens its writer."""


HELD_WHOLE: Final = {"jpeg": 4.5}
"""Bytes per pixel of formats that cannot be streamed: the picture, and what it is coded to."""
HELD_TURNED: Final = {"exr": 6.0, "tiff": 6.0, "png": 6.0, "jpeg": 3.0, "dng": 0.0}
"""Bytes per pixel of a picture that is turned upright; a DNG never is."""


def held_bytes(format_: str, *, pixels: int, orientation: int) -> int:
    """Return the memory of a writer that cannot hand on every row at once.

    Args:
        format_: As `open_writer` takes it.
        pixels: Of the picture.
        orientation: EXIF orientation of the capture.
    """
    turned = 0.0 if orientation == UPRIGHT else HELD_TURNED[format_]
    return int(pixels * (HELD_WHOLE.get(format_, 0.0) + turned))


def open_writer(
    path: Path, format_: str, picture: PictureFormat, *, product: str = IMAGE
) -> PictureWriter:
    """Open a product for writing, best as a context.

    Args:
        path: The file, usually the `.part` of `atomic_output`.
        format_: exr (linear), tiff or png (16 bits, tone of the format), jpeg (8 bits), or dng
            (camera colour).
        picture: Size, colour, orientation, tone and origin.
        product: What is written.

    Raises:
        ContractError: If nothing writes the product, or not in this format.
    """
    formats = WRITERS.get(product)
    if formats is None:
        raise ContractError(f"nothing writes {product!r}; there are {', '.join(WRITERS)}")
    if format_ not in formats:
        raise ContractError(
            f"format must be one of {', '.join(formats)} for {product}; got {format_!r}"
        )
    return formats[format_](path, picture)

"""Opens the writer of a format."""

from pathlib import Path
from typing import Final, Literal

from camkit.errors import ContractError
from camkit.runtime.output.picture_writer import PictureFormat, PictureWriter

PictureKind = Literal["exr", "tiff", "png"]
SUFFIXES: Final = {"exr": "exr", "tiff": "tif", "png": "png", "dng": "dng"}


def open_writer(path: Path, kind: PictureKind, picture: PictureFormat) -> PictureWriter:
    """Open a picture for writing, best as a context.

    Args:
        path: The file, usually the `.part` of `atomic_output`.
        kind: "exr" (linear), "tiff" or "png" (16 bits, tone of the format). A DNG needs more than
            a format: see `linear_dng`.
        picture: Size, colour, orientation and tone.

    Raises:
        ContractError: If the format is unknown.
    """
    if kind == "exr":
        from camkit.runtime.output.exr import ExrWriter

        return ExrWriter(path, picture)
    if kind == "tiff":
        from camkit.runtime.output.tiff import TiffWriter

        return TiffWriter(path, picture)
    if kind == "png":
        from camkit.runtime.output.png import PngWriter

        return PngWriter(path, picture)
    raise ContractError(f"format must be exr, tiff or png; got {kind!r}")

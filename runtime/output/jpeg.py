"""JPEG, 8 bits, with ICC profile and EXIF.

Pillow codes a picture as a whole, so it is held until it is: 4 bytes per pixel, 96 MB for 24
megapixels. Colour keeps its full resolution (4:4:4), since that is what was reconstructed.
"""

import io
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.color import encode_uint8
from camkit.runtime.output.directory import Kind
from camkit.runtime.output.exif import color_tags, exif_block
from camkit.runtime.output.icc import icc_profile
from camkit.runtime.output.picture_writer import Codes, PictureFormat, PictureWriter

MAX_SIDE_PX: Final = 65500
"""Longer sides are refused by libjpeg."""


def encode_jpeg(
    picture: Image.Image, *, quality: int, icc: bytes = b"", exif: bytes = b""
) -> bytes:
    """Encode an RGB or grey picture.

    Args:
        picture: 8 bits per channel.
        quality: 1..100.
        icc: Its profile; none if empty.
        exif: Its EXIF block; none if empty.
    """
    coded = io.BytesIO()
    picture.save(
        coded,
        "JPEG",
        quality=quality,
        subsampling=0,
        icc_profile=icc or None,
        exif=b"Exif\0\0" + exif if exif else b"",
    )
    return coded.getvalue()


class JpegWriter(PictureWriter):
    """Holds the codes of a picture and writes them at the end."""

    def __init__(self, path: Path, picture: PictureFormat) -> None:
        """Open the writer.

        Raises:
            ContractError: If a side is longer than a JPEG can be.
        """
        super().__init__(path, picture)
        width, height = picture.file_size
        if max(width, height) > MAX_SIDE_PX:
            raise ContractError(
                f"a JPEG has sides of at most {MAX_SIDE_PX} px; got {width}x{height}; "
                f"choose {option_text('format')} png or tiff"
            )
        self._image = Image.new("L" if picture.is_grey else "RGB", (width, height))
        self._stored = 0

    def encode(self, band: FloatArray) -> Codes:
        """Return the band as uint8 codes."""
        return encode_uint8(band, tone=self.picture.tone)

    def store(self, rows: Codes) -> None:
        """Store rows, interleaved."""
        interleaved = np.ascontiguousarray(rows.transpose(1, 2, 0))
        pixels = interleaved[..., 0] if self.picture.is_grey else interleaved
        self._image.paste(Image.fromarray(pixels), (0, self._stored))
        self._stored += rows.shape[1]

    def finish(self) -> None:
        """Write the file."""
        coded = encode_jpeg(
            self._image,
            quality=self.picture.jpeg_quality,
            icc=icc_profile(
                self.picture.color, tone=self.picture.tone, is_grey=self.picture.is_grey
            ),
            exif=self._exif(),
        )
        self.path.write_bytes(coded)

    def release(self) -> None:
        """Release nothing: nothing is open before the end."""

    def _exif(self) -> bytes:
        width, height = self.picture.file_size
        components = bytes((1, 0, 0, 0) if self.picture.is_grey else (1, 2, 3, 0))
        return exif_block(
            self.picture.origin.metadata,
            main={531: (Kind.SHORT, 1)},  # YCbCrPositioning: centred
            exif={
                **color_tags(self.picture),
                37121: (Kind.UNDEFINED, components),  # ComponentsConfiguration: Y, or YCbCr
                40962: (Kind.LONG, width),  # PixelXDimension
                40963: (Kind.LONG, height),  # PixelYDimension
            },
        )

"""Rows of pictures in one PNG or JPEG, pixel for pixel, with a caption over each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from camkit.arrays import FloatArray

GAP_PX: Final = 6
JPEG: Final = (
    *(cv2.IMWRITE_JPEG_QUALITY, 90),
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
)
LEAST_TEXT_PX: Final = 12
TEXT_SHARE: Final = 1 / 24
"""Size of the text as a share of a picture's width: 16 px over pictures of 384 px."""

Line = tuple[int, int, str, str]
"""Left and top in pixels, the text, its weight."""


def write_captioned(path: Path, heading: str, rows: Mapping[str, Mapping[str, FloatArray]]) -> None:
    """Write rows of pictures under a heading; text lies in white strips, never on a picture.

    Args:
        path: PNG or JPEG.
        heading: Text above all rows; may hold line breaks.
        rows: Title -> caption -> (3, h, w) sRGB values in 0..1, all of one size.

    Raises:
        OSError: If the file cannot be written.
    """
    _, height, width = next(iter(next(iter(rows.values())).values())).shape
    line_px = 2 * text_px(width)
    lines: list[Line] = [
        (0, number * line_px, text, "bold") for number, text in enumerate(heading.splitlines())
    ]
    top = len(lines) * line_px
    tiles = []
    for title, row in rows.items():
        lines.append((0, top, title, "bold"))
        for column, (caption, picture) in enumerate(row.items()):
            left = column * (width + GAP_PX)
            lines.append((left, top + line_px, caption, "normal"))
            tiles.append((left, top + 2 * line_px, picture))
        top += 2 * line_px + height
    page = _draw_text(lines, top, max(map(len, rows.values())) * (width + GAP_PX), text_px(width))
    for left, upper, picture in tiles:
        pixels = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8).transpose(1, 2, 0)
        page[upper : upper + height, left : left + width] = pixels[..., ::-1]
    write_pixels(path, page)


def write_pixels(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write (h, w, 3) BGR as PNG, or as JPEG with colours as fine as brightness.

    Raises:
        OSError: If the file cannot be written.
    """
    if not cv2.imwrite(str(path), pixels, JPEG if path.suffix == ".jpg" else ()):
        raise OSError(f"cannot write {path}")


def text_px(width_px: int) -> int:
    """Return the size of the text over pictures of a width; a line takes twice that."""
    return max(int(width_px * TEXT_SHARE), LEAST_TEXT_PX)


def _draw_text(lines: Sequence[Line], height: int, width: int, size_px: int) -> NDArray[np.uint8]:
    """Return a white page (height, width, 3), BGR, with lines of text."""
    page = Image.new("L", (width, height), 255)
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size_px)
    for left, top, text, weight in lines:
        at = (left + size_px / 4, top + size_px)
        pen.text(at, text, 0, font, anchor="lm", stroke_width=0.4 * (weight == "bold"))
    return np.repeat(np.asarray(page, np.uint8)[..., None], 3, axis=2)

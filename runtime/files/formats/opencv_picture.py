"""Pictures through OpenCV: PNG, JPEG, Radiance HDR and whatever else it knows.

Its silent limits with TIFF (planes, packed bits, MinIsWhite, alpha) are met by `tiff_picture`.
"""

from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.files.formats import jpeg_segments, png_chunks, radiance, stated_space
from camkit.runtime.files.formats.decoded import Decoded
from camkit.runtime.files.formats.stated_space import NOTHING, StatedSpace
from camkit.runtime.files.tiff_tags import TiffTags

_SAMPLES: Final = (np.uint8, np.uint16, np.float32)


def decode_picture(data: bytes, exif: TiffTags) -> Decoded:
    """Decode a file of any kind but TIFF and EXR.

    Args:
        data: The whole file.
        exif: Of the file.

    Raises:
        DecodeError: If it is damaged, cut off, or of a kind that is not read.
    """
    statement, notes = NOTHING, list[str]()
    if data.startswith(radiance.MAGIC):
        radiance.check_header(data)
    elif data.startswith(jpeg_segments.MAGIC):
        data = data[: jpeg_segments.end_of_jpeg(data)]
        statement = stated_space.space_of_jpeg(data, exif)
    elif data.startswith(png_chunks.MAGIC):
        png_chunks.check_png_size(data)
        statement = stated_space.space_of_png(data, exif)
        if any(name == b"acTL" for name, _ in png_chunks.png_chunks(data)):
            notes.append("animated PNG: only the first picture is read")
    samples, alpha = split_alpha(decode_array(data))
    notes += ["alpha channel dropped"] if alpha is not None else []
    return decoded_samples(samples, statement, tuple(notes))


def decoded_samples(
    samples: NDArray[Any],
    statement: StatedSpace,
    notes: tuple[str, ...] = (),
    top: int | None = None,
) -> Decoded:
    """Return samples with the space that their file states, white at the top of their type."""
    if top is None:
        is_code = np.issubdtype(samples.dtype, np.integer)
        top = int(np.iinfo(samples.dtype).max) if is_code else 0
    statement = statement.of_channels(samples.ndim)
    return Decoded(
        samples=samples,
        top=top,
        space=statement.space,
        doubt=statement.doubt,
        notes=notes,
    )


def decode_array(data: bytes | bytearray) -> NDArray[Any]:
    """Decode to (h, w) or (h, w, BGR[A]).

    Raises:
        DecodeError: If OpenCV cannot.
    """
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        decoded = (
            cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
        )
    except cv2.error as error:
        raise DecodeError(f"the picture cannot be decoded: {error.err or error}") from error
    finally:
        cv2.utils.logging.setLogLevel(level)
    if decoded is None:
        raise DecodeError(
            "the picture is damaged or of an unknown kind; expected EXR, PNG, TIFF, JPEG or HDR"
        )
    if decoded.dtype not in _SAMPLES:
        raise DecodeError(f"samples must be 8-bit, 16-bit or float32; got {decoded.dtype}")
    return np.asarray(decoded)


def split_alpha(decoded: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any] | None]:
    """Return (h, w) or planes R, G, B of OpenCV's (h, w, BGR[A]), and alpha."""
    if decoded.ndim == 2:
        return decoded, None
    channels = decoded.shape[2]
    if channels not in (3, 4):
        raise DecodeError(f"expected 1, 3 or 4 channels; got {channels}")
    planes = np.ascontiguousarray(decoded[..., 2::-1].transpose(2, 0, 1))
    return planes, decoded[..., 3] if channels == 4 else None

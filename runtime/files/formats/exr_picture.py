"""An OpenEXR file: the first of its parts that is a flat picture of R, G, B or of luminance.

Channels may be named in lower case or lie in a layer (`beauty.R`), and chroma may be stored at a
part of the places as (R - Y) / Y and (B - Y) / Y.

Reference: OpenEXR, "Technical Introduction" (parts, windows, luminance and chroma, layers).
"""

import contextlib
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import D65, REC709_PRIMARIES, Matrix, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.picture_window import PictureWindow
from camkit.runtime.files.exr_attributes import metadata_of_exr, place_of_exr
from camkit.runtime.files.formats.color_space import ColorSpace, matrix_to_rec709, power_curve
from camkit.runtime.files.formats.decoded import Decoded
from camkit.runtime.files.raw_checks import MAX_PIXELS
from camkit.runtime.files.raw_tags import SensorPlace
from camkit.runtime.metadata import Metadata

MAGIC: Final = b"\x76\x2f\x31\x01"
MOST_PX_PER_BYTE: Final = 4096
NOT_REC709: Final = "chromaticities of the EXR are not Rec.709: colours are used unconverted"
_DEEP: Final = ("deepscanline", "deeptile")
_PREFERRED: Final = ("rgba", "rgb", "beauty", "combined", "color", "colour")
_WHOLE: Final = "samples are integers (UINT): they are read as linear light, 1 is white"
_TOLERANCE: Final = 2e-3
_DAMAGED: Final = (RuntimeError, ValueError, TypeError, KeyError, IndexError, AttributeError)
"""Errors that the package raises, depending on where the damage lies."""

# OpenEXR.File prints its warnings; they must not land in stdout, which may carry JSON
_lock = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """A part that is a picture.

    Attributes:
        number: From 0.
        header: Its attributes.
        channels: R, G, B; or Y; or Y, RY, BY, as the file names them.
        unread: Channels that are not read.
    """

    number: int
    header: Mapping[str, Any]
    channels: tuple[str, ...]
    unread: tuple[str, ...]


def decode_exr(path: Path) -> tuple[Decoded, Metadata, SensorPlace]:
    """Decode a file: float32 samples of its data window, and what it says of the photograph.

    The last is its place on the sensor, as `merge` leaves it.

    Raises:
        DecodeError: If it is damaged, deep, or holds no colour; says which.
    """
    with _lock, contextlib.redirect_stdout(sys.stderr):
        try:
            parts = _headers(path)
            part = _picture_of(parts)
            window = _window(part.header)
            planes, is_whole = _read(path, part, window)
        except DecodeError:
            raise
        except _DAMAGED as error:
            raise DecodeError(f"the EXR is damaged: {error}") from error
    samples = planes[0] if len(part.channels) == 1 else np.stack(planes)
    if part.channels[-1].endswith("BY"):
        samples = _rgb_of_chroma(planes, part.header.get("chromaticities"))
    decoded = Decoded(
        samples=samples,
        top=0,
        space=_space(part.header.get("chromaticities")),
        window=window,
        notes=(*_notes(parts, part, window), *([_WHOLE] if is_whole else [])),
    )
    return decoded, metadata_of_exr(part.header), place_of_exr(part.header)


def read_exr_place(path: Path) -> SensorPlace:
    """Read the place on the sensor alone, without samples.

    Raises:
        DecodeError: If the header is damaged, or holds no picture.
        OSError: If the file cannot be read.
    """
    with _lock, contextlib.redirect_stdout(sys.stderr):
        try:
            return place_of_exr(_picture_of(_headers(path)).header)
        except _DAMAGED as error:
            raise DecodeError(f"the EXR is damaged: {error}") from error


def _headers(path: Path) -> list[dict[str, Any]]:
    """Return the attributes of every part, within what the file can hold."""
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        # the file empties its own on closing
        headers = [dict(part.header) for part in file.parts]
    file_bytes = path.stat().st_size
    for header in headers:
        x0, y0, x1, y1 = _box(header["dataWindow"])
        wide, high = x1 - x0 + 1, y1 - y0 + 1
        count = max(1, len(header["channels"])) if not _is_deep(header) else 1
        most = min(MAX_PIXELS, file_bytes * MOST_PX_PER_BYTE // count)
        if high < 1 or wide < 1 or high * wide > most:
            raise DecodeError(f"the header claims {wide}x{high} pixels in {file_bytes} bytes")
    return headers


def _picture_of(headers: Sequence[Mapping[str, Any]]) -> _Part:
    """Return the first part that is a flat picture."""
    refusals = []
    for number, header in enumerate(headers):
        if _is_deep(header):
            refusals.append("a deep EXR has many samples per pixel and is not read; flatten it")
            continue
        names = [channel.name for channel in header["channels"]]
        try:
            channels = _color_channels(names)
        except DecodeError as error:
            refusals.append(str(error))
            continue
        unread = tuple(name for name in names if name not in channels)
        return _Part(number=number, header=header, channels=channels, unread=unread)
    raise DecodeError(refusals[0] if refusals else "the EXR has no part")


def _is_deep(header: Mapping[str, Any]) -> bool:
    return getattr(header.get("type"), "name", "") in _DEEP


def _color_channels(names: Sequence[str]) -> tuple[str, ...]:
    """Return the channels of colour as they are named, of the plain layer if there is one."""
    layers: dict[str, dict[str, str]] = {}
    for name in names:
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, {}).setdefault(channel.upper(), name)
    complete = {}
    for layer, members in layers.items():
        for letters in (("R", "G", "B"), ("Y", "RY", "BY"), ("Y",)):
            if members.keys() >= set(letters):
                complete[layer] = tuple(members[channel] for channel in letters)
                break
    if "" in complete or len(complete) == 1:
        return complete.get("") or next(iter(complete.values()))
    for preferred in _PREFERRED:
        matches = [layer for layer in complete if layer.rpartition(".")[2].lower() == preferred]
        if len(matches) == 1:
            return complete[matches[0]]
    if complete:
        raise DecodeError(
            f"the EXR has {len(complete)} layers ({', '.join(list(complete)[:5])}) and none is "
            "plain R, G, B; save the one that is meant as such"
        )
    raise DecodeError(f"expected EXR channels R, G, B or Y; got {sorted(names)[:12]}")


def _window(header: Mapping[str, Any]) -> PictureWindow:
    aspect = float(header.get("pixelAspectRatio", 1.0))
    return PictureWindow(
        data=_box(header["dataWindow"]),
        display=_box(header["displayWindow"]),
        pixel_aspect=aspect if 0 < aspect < 1e6 else 1.0,
    )


def _box(corners: Any) -> tuple[int, int, int, int]:
    (x0, y0), (x1, y1) = (np.asarray(corner).tolist() for corner in corners)
    return x0, y0, x1, y1


def _read(path: Path, part: _Part, window: PictureWindow) -> tuple[list[FloatArray], bool]:
    """Return (h, w) of every channel, chroma filled in, and whether any holds integers."""
    import OpenEXR

    wide, high = window.size_px
    planes = []
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.parts[part.number].channels
        for name in part.channels:
            stored, steps = np.asarray(channels[name].pixels), _steps(channels[name])
            x0, y0 = window.data[:2]
            planes.append(stored if steps == (1, 1) else _filled(stored, steps, (x0, y0)))
    for plane in planes:
        if plane.shape != (high, wide):
            raise DecodeError(f"EXR channels differ in size: {[p.shape for p in planes]}")
    is_whole = any(np.issubdtype(plane.dtype, np.integer) for plane in planes)
    return [plane.astype(np.float32) for plane in planes], is_whole


def _steps(channel: Any) -> tuple[int, int]:
    return int(channel.xSampling), int(channel.ySampling)


def _filled(
    stored: NDArray[Any], steps: tuple[int, int], origin_px: tuple[int, int]
) -> NDArray[Any]:
    """Fill in a channel that has a sample at every step of columns and rows, linearly."""
    filled = stored.astype(np.float32)
    for axis, step, first in ((1, steps[0], origin_px[0]), (0, steps[1], origin_px[1])):
        count = filled.shape[axis]
        at = np.clip((np.arange(count * step) - (-first % step)) / step, 0, count - 1)
        low = np.minimum(at.astype(int), max(count - 2, 0))
        share = (at - low).astype(np.float32)
        share = share[None, :] if axis == 1 else share[:, None]
        high = np.minimum(low + 1, count - 1)
        filled = filled.take(low, axis) * (1 - share) + filled.take(high, axis) * share
    return filled


def _rgb_of_chroma(planes: Sequence[FloatArray], chromaticities: Any) -> FloatArray:
    """Return (3, h, w) R, G, B of luminance and chroma."""
    points = _points(chromaticities)
    primaries, white = (points[:3], points[3]) if points else (REC709_PRIMARIES, D65)
    weights = rgb_to_xyz(tuple(primaries), white)[1].astype(np.float32)
    y, red_chroma, blue_chroma = planes
    red, blue = (red_chroma + 1) * y, (blue_chroma + 1) * y
    green = (y - weights[0] * red - weights[2] * blue) / weights[1]
    return np.stack([red, green, blue])


def _notes(
    headers: Sequence[Mapping[str, Any]], part: _Part, window: PictureWindow
) -> tuple[str, ...]:
    """Return notes on unread parts, and on the place of the pixels."""
    plain = [name for name in part.unread if name.upper() == "A"]
    rest = [name for name in part.unread if name not in plain]
    notes = ["alpha channel dropped"] if plain else []
    if rest:
        more = ", ..." if len(rest) > 5 else ""
        notes.append(f"channels not read: {', '.join(rest[:5])}{more}")
    if len(part.channels) > 1 and part.channels[-1].endswith("BY"):
        notes.append("luminance and subsampled chroma: chroma is interpolated")
    layer = part.channels[0].rpartition(".")[0]
    notes += [f"layer {layer!r} is read"] if layer else []
    others = [
        str(header.get("name") or f"part {number}")
        for number, header in enumerate(headers)
        if number != part.number
    ]
    if others:
        more = ", ..." if len(others) > 5 else ""
        notes.append(f"parts not read: {', '.join(others[:5])}{more}")
    chromaticities = part.header.get("chromaticities")
    if chromaticities is not None and _is_cut(chromaticities):
        notes.append("chromaticities of the EXR are cut to whole numbers: Rec.709 is assumed")
    return (*notes, window.note) if window.note else tuple(notes)


def _points(chromaticities: Any) -> list[tuple[float, float]] | None:
    """Return chromaticities of R, G, B and white; None where none are stated.

    Raises:
        DecodeError: If they are not believable.
    """
    if chromaticities is None or _is_cut(chromaticities):
        return None
    values = np.asarray(chromaticities, dtype=np.float64).ravel()
    # primaries may be imaginary (of ACES 2065-1, of XYZ itself); the white may not
    if values.shape != (8,) or not np.isfinite(values).all() or values[-1] <= 0:
        raise DecodeError(f"EXR chromaticities are not believable: {values.tolist()}")
    return [(float(x), float(y)) for x, y in values.reshape(4, 2)]


def _is_cut(chromaticities: Any) -> bool:
    """Return whether OpenEXR.OutputFile (3.5.3) wrote them: whole numbers, of white zeros."""
    values = np.asarray(chromaticities, dtype=np.float64).ravel()
    return np.array_equal(values, np.trunc(values)) and not np.any(values[6:])


def _space(chromaticities: Any) -> ColorSpace | None:
    """Return the space of the file's primaries; None if they are Rec.709."""
    points = _points(chromaticities)
    expected = np.array([*np.ravel(REC709_PRIMARIES), *D65])
    if points is None or np.abs(np.ravel(points) - expected).max() <= _TOLERANCE:
        return None
    try:
        matrix: Matrix = matrix_to_rec709(tuple(points[:3]), points[3])
    except np.linalg.LinAlgError as error:
        raise DecodeError(f"EXR chromaticities are not believable: {points}") from error
    if not np.isfinite(matrix).all():
        raise DecodeError(f"EXR chromaticities are not believable: {points}")
    return ColorSpace(name="chromaticities", curves=(power_curve(1.0),) * 3, to_rec709=matrix)

"""ICC profiles: curves and a matrix where a profile is made of them, else LittleCMS.

LittleCMS of Pillow takes and gives 8 bits alone, which is too few for 16-bit scenes and cuts what
lies outside sRGB. So profiles of curves and colorants, which are nearly all that pictures embed,
are evaluated here; those with tables go through LittleCMS.

References: ICC.1:2022, 8 (which tags a profile has), 10.6 (curveType), 10.18 (parametricCurveType).
"""

import io
import struct
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

from camkit.colorimetry import D65, REC709_PRIMARIES, Matrix, adapt_white, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.runtime.files.formats.color_space import ColorSpace, Curve, FloatGrid, power_curve

PCS_WHITE: Final = (0.3457, 0.3585)
"""D50, to which profiles adapt their colorants."""
MOST_PROFILE_BYTES: Final = 4_000_000
_HEADER: Final = 128
_SIGNATURE: Final = (b"acsp", 36)
_MOST_TAGS: Final = 200
_PARAMETERS: Final = (1, 3, 4, 5, 7)
_TABLES: Final = (b"A2B0", b"D2B0")
_COLORANTS: Final = (b"rXYZ", b"gXYZ", b"bXYZ")
_CURVES: Final = (b"rTRC", b"gTRC", b"bTRC")


def space_of_profile(profile: bytes) -> ColorSpace:
    """Return the colour space of a profile of RGB or grey.

    Raises:
        DecodeError: If it is damaged, or of another kind of colour; names it.
    """
    if len(profile) > MOST_PROFILE_BYTES:
        raise DecodeError(f"a colour profile of {len(profile)} bytes")
    try:
        tags = _tags(profile)
        name = _name(tags)
        colours = profile[16:20]
        if colours == b"GRAY" and b"kTRC" in tags:
            return ColorSpace(name=name, curves=(_curve(tags[b"kTRC"]),), to_rec709=np.eye(3))
        if colours == b"RGB " and not any(tag in tags for tag in _TABLES):
            curves = tuple(_curve(tags[tag]) for tag in _CURVES)
            return ColorSpace(name=name, curves=curves, to_rec709=_matrix(tags))
    except (struct.error, ValueError, KeyError, IndexError, np.linalg.LinAlgError) as error:
        raise DecodeError("a colour profile that is damaged") from error
    if colours != b"RGB ":
        kind = colours.decode("latin-1").strip()
        raise DecodeError(f"the colour profile {name!r} of {kind} colours, neither RGB nor grey")
    return ColorSpace(name=name, to_rec709=np.eye(3), tables=_LittleCms(profile, name))


class _LittleCms:
    """The way of 8-bit codes through the tables of a profile to sRGB."""

    def __init__(self, profile: bytes, name: str) -> None:
        try:
            self._transform = ImageCms.buildTransform(
                ImageCms.ImageCmsProfile(io.BytesIO(profile)),
                ImageCms.createProfile("sRGB"),
                "RGB",
                "RGB",
                ImageCms.Intent.RELATIVE_COLORIMETRIC,
            )
        except (ImageCms.PyCMSError, OSError) as error:
            raise DecodeError(f"the colour profile {name!r}, which is damaged") from error

    def __call__(self, codes: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Convert (h, w, 3) codes."""
        picture = ImageCms.applyTransform(Image.fromarray(codes), self._transform)
        if picture is None:
            raise DecodeError("LittleCMS gave no picture")
        return np.asarray(picture)


def _tags(profile: bytes) -> dict[bytes, bytes]:
    signature, place = _SIGNATURE
    if profile[place : place + len(signature)] != signature:
        raise ValueError("no profile")
    (count,) = struct.unpack_from(">I", profile, _HEADER)
    if count not in range(1, _MOST_TAGS + 1):
        raise ValueError(f"{count} tags")
    tags = {}
    for number in range(count):
        name, start, size = struct.unpack_from(">4sII", profile, _HEADER + 4 + 12 * number)
        tags[name] = profile[start : start + size]
    return tags


def _name(tags: Mapping[bytes, bytes]) -> str:
    """Return the profile's own name."""
    data = tags.get(b"desc", b"")
    text = ""
    if data[:4] == b"mluc":
        size, start = struct.unpack_from(">II", data, 20)
        text = data[start : start + size].decode("utf-16-be", "replace")
    if data[:4] == b"desc":
        (size,) = struct.unpack_from(">I", data, 8)
        text = data[12 : 12 + size].decode("latin-1")
    printable = "".join(c if c.isprintable() else " " for c in text.split("\0")[0])[:60]
    return printable.strip() or "without a name"


def _matrix(tags: Mapping[bytes, bytes]) -> Matrix:
    """Return the matrix to Rec.709 of colorants, which are adapted to D50."""
    colorants = np.stack(
        [np.array(struct.unpack_from(">3i", tags[name], 8)) / 65536 for name in _COLORANTS], axis=1
    )
    if abs(np.linalg.det(colorants)) < 1e-6:
        raise ValueError("singular colorants")
    to_d65 = adapt_white(PCS_WHITE, D65)
    return np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ to_d65 @ colorants)


def _curve(data: bytes) -> Curve:
    """Return the curve of a tag."""
    if data[:4] == b"para":
        return _parametric(data)
    if data[:4] != b"curv":
        raise ValueError("no curve")
    (count,) = struct.unpack_from(">I", data, 8)
    if count > len(data):
        raise ValueError("a curve beyond its tag")
    table = np.array(struct.unpack_from(f">{count}H", data, 12), dtype=np.float64)
    if count == 0:
        return power_curve(1.0)
    if count == 1:
        return power_curve(float(table[0]) / 256)
    at = np.linspace(0, 1, count)
    return lambda codes: np.asarray(np.interp(codes, at, table / 65535))


def _parametric(data: bytes) -> Curve:
    kind = struct.unpack_from(">H", data, 8)[0]
    values = struct.unpack_from(f">{_PARAMETERS[kind]}i", data, 12)
    g, a, b, c, d, e, f = (*(n / 65536 for n in values), *[0.0] * 7)[:7]
    if kind == 0:
        return power_curve(g)

    def light(codes: FloatGrid) -> FloatGrid:
        power = np.maximum(a * codes + b, 0) ** g
        if kind in (1, 2):
            return np.asarray(power + (c if kind == 2 else 0))
        return np.asarray(np.where(codes >= d, power + e, c * codes + f))

    return light

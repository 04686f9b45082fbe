"""The ICC profile of a picture file: which RGB its numbers mean.

sRGB and Adobe RGB are told by their colorants and curves, since their names vary. Numbers of
Adobe RGB become light by a power of 563 / 256.

References: ICC.1:2022 (tags); IEC 61966-2-1 (sRGB); Adobe RGB (1998) Color Image Encoding.
"""

import io
import struct
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from camkit.colorimetry import D65, REC709_PRIMARIES, Matrix, adapt_white, rgb_to_xyz
from camkit.errors import DecodeError

Space = Literal["sRGB", "Adobe RGB"]

ADOBE_RGB_PRIMARIES: Final = ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06))
ADOBE_RGB_GAMMA: Final = 563 / 256
PCS_WHITE: Final = (0.3457, 0.3585)
"""D50, to which profiles adapt their colorants."""
MOST_PROFILE_BYTES: Final = 4_000_000
_COLORANT_ERROR: Final = 0.004
_CURVE_ERROR: Final = 0.004
_HEADER: Final = 128
_MOST_TAGS: Final = 200
_TESTED: Final = np.linspace(0, 1, 17)
_PARAMETERS: Final = (1, 3, 4, 5, 7)


def space_of(path: Path) -> Space:
    """Tell the colour space of a picture file; sRGB where it embeds no profile.

    Raises:
        DecodeError: If the profile is damaged, or is neither sRGB nor Adobe RGB; names it.
    """
    profile = _embedded(path)
    if profile is None:
        return "sRGB"
    try:
        tags = _tags(profile)
        name = _name(tags)
        found = _known(tags)
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise DecodeError(
            f"{path.name} embeds a colour profile that is damaged or no RGB with curves; save it "
            "as sRGB"
        ) from error
    if found is None:
        raise DecodeError(
            f"{path.name} embeds the profile {name!r}; expected sRGB or Adobe RGB (1998): convert "
            "it"
        )
    return found


def _embedded(path: Path) -> bytes | None:
    """Give the profile; None where there is none, or the file is of a kind that holds none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(path.read_bytes())) as picture:
                profile = picture.info.get("icc_profile")
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None  # the reader of pixels says what is wrong, or knows more kinds
    if not isinstance(profile, bytes) or not profile:
        return None
    if len(profile) > MOST_PROFILE_BYTES:
        raise DecodeError(f"{path.name} embeds a colour profile of {len(profile)} bytes")
    return profile


def _tags(profile: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", profile, _HEADER)
    if count not in range(1, _MOST_TAGS + 1):
        raise ValueError(f"{count} tags")
    tags = {}
    for number in range(count):
        name, start, size = struct.unpack_from(">4sII", profile, _HEADER + 4 + 12 * number)
        tags[name] = profile[start : start + size]
    return tags


def _name(tags: Mapping[bytes, bytes]) -> str:
    """Give the profile's own name."""
    data = tags.get(b"desc", b"")
    if data[:4] == b"mluc":
        size, start = struct.unpack_from(">II", data, 20)
        return data[start : start + size].decode("utf-16-be", "replace").strip("\0 ")
    if data[:4] == b"desc":
        (size,) = struct.unpack_from(">I", data, 8)
        return data[12 : 12 + size].decode("latin-1").strip("\0 ")
    return "without a name"


def _known(tags: Mapping[bytes, bytes]) -> Space | None:
    if b"rXYZ" not in tags or b"rTRC" not in tags:
        return None
    colorants = np.stack([_xyz(tags[name]) for name in (b"rXYZ", b"gXYZ", b"bXYZ")], axis=1)
    curves = [_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC")]
    adapt = adapt_white(D65, PCS_WHITE)
    srgb = np.where(_TESTED <= 0.04045, _TESTED / 12.92, ((_TESTED + 0.055) / 1.055) ** 2.4)
    spaces: tuple[tuple[Space, Matrix, NDArray[np.float64]], ...] = (
        ("sRGB", rgb_to_xyz(REC709_PRIMARIES, D65), srgb),
        ("Adobe RGB", rgb_to_xyz(ADOBE_RGB_PRIMARIES, D65), _TESTED**ADOBE_RGB_GAMMA),
    )
    for name, to_xyz, wanted in spaces:
        alike = np.abs(colorants - adapt @ to_xyz).max() < _COLORANT_ERROR
        if alike and all(np.abs(curve - wanted).max() < _CURVE_ERROR for curve in curves):
            return name
    return None


def _xyz(data: bytes) -> NDArray[np.float64]:
    return np.array(struct.unpack_from(">3i", data, 8)) / 65536


def _curve(data: bytes) -> NDArray[np.float64]:
    """Give the light that a curve makes of `_TESTED`."""
    if data[:4] == b"para":
        kind = struct.unpack_from(">H", data, 8)[0]
        values = struct.unpack_from(f">{_PARAMETERS[kind]}i", data, 12)
        g, a, b, c, d, e, f = (*(n / 65536 for n in values), *[0.0] * 7)[:7]
        if kind == 0:
            return np.asarray(_TESTED**g)
        if kind in (1, 2):
            return np.asarray(np.maximum(a * _TESTED + b, 0) ** g + (c if kind == 2 else 0))
        power = np.maximum(a * _TESTED + b, 0) ** g
        return np.asarray(np.where(d <= _TESTED, power + e, c * _TESTED + f))
    if data[:4] != b"curv":
        raise ValueError("no curve")
    (count,) = struct.unpack_from(">I", data, 8)
    table = np.array(struct.unpack_from(f">{count}H", data, 12), dtype=np.float64)
    if count == 0:
        return _TESTED.copy()
    if count == 1:
        return np.asarray(_TESTED ** (table[0] / 256))
    return np.asarray(np.interp(_TESTED, np.linspace(0, 1, count), table / 65535))

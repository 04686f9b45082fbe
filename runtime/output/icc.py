"""ICC profiles of matrix type, made from primaries, white point and tone curve.

Version 4.3: colorants adapted to D50 by Bradford, tone as a parametric curve.
References: ICC.1:2010 (profile version 4.3), clauses 7.2, 8.3, 10.
"""

import struct
from functools import cache
from typing import Final

from camkit.colorimetry import Chromaticity, Matrix, adapt_white, rgb_to_xyz
from camkit.runtime.color import ColorStage

VERSION_4_3: Final = 0x04300000
HEADER_BYTES: Final = 128
# The PCS illuminant must be these digits; D50 by its chromaticity differs in the fourth.
PCS_XYZ: Final = (0.9642, 1.0, 0.8249)
PCS_WHITE: Final[Chromaticity] = (PCS_XYZ[0] / sum(PCS_XYZ), PCS_XYZ[1] / sum(PCS_XYZ))
COPYRIGHT: Final = "No copyright, use freely"
# Fixed, so that equal pictures are equal files.
CREATED: Final = (2026, 1, 1, 0, 0, 0)
# y = (a x + b)^g for x >= d, c x below: IEC 61966-2-1 as parametric curve type 3.
SRGB_CURVE: Final = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)

SPACE_TITLES: Final = {"rec709": "Rec.709", "acescg": "ACEScg", "camera": "camera"}


def icc_profile(stage: ColorStage, *, tone: str, is_grey: bool = False) -> bytes:
    """Return the profile of pictures in an output space.

    Args:
        stage: Colour stage; its primaries and white define the colorants.
        tone: "srgb" for the sRGB curve, anything else for linear.
        is_grey: Whether they have one channel, to which the curve alone applies.
    """
    is_srgb = stage.space == "rec709" and tone == "srgb"
    curve = "sRGB tone" if tone == "srgb" else "linear"
    if is_grey:
        return _grey_profile(f"grey {curve} (camkit)", tone == "srgb")
    title = "sRGB (camkit)" if is_srgb else f"{SPACE_TITLES[stage.space]} {curve} (camkit)"
    return _profile(title, (*stage.primaries, stage.white), tone == "srgb")


@cache
def _profile(title: str, points: tuple[tuple[float, float], ...], is_srgb_tone: bool) -> bytes:
    *primaries, white = points
    adapt = adapt_white(white, PCS_WHITE)
    colorants = adapt @ rgb_to_xyz(tuple(primaries), white)
    curve = _curve(SRGB_CURVE) if is_srgb_tone else _curve((1.0,))
    tags = [
        (b"desc", _text(title)),
        (b"cprt", _text(COPYRIGHT)),
        (b"wtpt", _xyz(PCS_XYZ)),
        (b"chad", b"sf32" + bytes(4) + b"".join(_fixed(v) for v in adapt.ravel())),
        (b"rXYZ", _xyz(colorants[:, 0])),
        (b"gXYZ", _xyz(colorants[:, 1])),
        (b"bXYZ", _xyz(colorants[:, 2])),
        (b"rTRC", curve),
        (b"gTRC", curve),
        (b"bTRC", curve),
    ]
    return _assemble(tags)


@cache
def _grey_profile(title: str, is_srgb_tone: bool) -> bytes:
    tags = [
        (b"desc", _text(title)),
        (b"cprt", _text(COPYRIGHT)),
        (b"wtpt", _xyz(PCS_XYZ)),
        (b"kTRC", _curve(SRGB_CURVE) if is_srgb_tone else _curve((1.0,))),
    ]
    return _assemble(tags, space=b"GRAY")


def _assemble(tags: list[tuple[bytes, bytes]], *, space: bytes = b"RGB ") -> bytes:
    start = HEADER_BYTES + 4 + 12 * len(tags)
    table, data = struct.pack(">I", len(tags)), b""
    offsets: dict[bytes, int] = {}
    for name, content in tags:
        # Equal contents (the three curves) are stored once, as the standard allows.
        if content not in offsets:
            offsets[content] = start + len(data)
            data += content + bytes(-len(content) % 4)
        table += name + struct.pack(">II", offsets[content], len(content))
    header = struct.pack(
        ">I4xI4s4s4s6H4s4xI4xI8xI12s",
        start + len(data),
        VERSION_4_3,
        b"mntr",
        space,
        b"XYZ ",
        *CREATED,
        b"acsp",
        0,
        0,
        0,
        b"".join(_fixed(v) for v in PCS_XYZ),
    )
    return header.ljust(HEADER_BYTES, b"\0") + table + data


def _fixed(value: float) -> bytes:
    return struct.pack(">i", round(float(value) * 65536))


def _xyz(values: Matrix | tuple[float, ...]) -> bytes:
    return b"XYZ " + bytes(4) + b"".join(_fixed(v) for v in values)


def _curve(parameters: tuple[float, ...]) -> bytes:
    kind = 3 if len(parameters) > 1 else 0
    return b"para" + struct.pack(">4xHH", kind, 0) + b"".join(_fixed(v) for v in parameters)


def _text(text: str) -> bytes:
    coded = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">4xII2s2sII", 1, 12, b"en", b"US", len(coded), 28) + coded

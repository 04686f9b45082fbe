"""The colour space that a file states: ICC profile, chunks of PNG, Exif.

References: ICC.1:2022, annex B (profiles in JPEG and TIFF); PNG, third edition, 4.3 (precedence of
cICP, iCCP, sRGB, gAMA with cHRM), 11.3.2; Exif 2.32, 4.6.5 (ColorSpace, InteroperabilityIndex);
DCF 2.0 (R03: Adobe RGB).
"""

import struct
import zlib
from dataclasses import dataclass
from typing import Final

from camkit.colorimetry import D65, REC709_PRIMARIES
from camkit.errors import DecodeError
from camkit.runtime.files.formats import color_space
from camkit.runtime.files.formats.color_space import ColorSpace, power_curve, space_of_primaries
from camkit.runtime.files.formats.icc_profile import MOST_PROFILE_BYTES, space_of_profile
from camkit.runtime.files.formats.jpeg_segments import header_segments
from camkit.runtime.files.formats.png_chunks import png_chunks
from camkit.runtime.files.tiff_tags import TiffTags

_ICC_OF_JPEG: Final = b"ICC_PROFILE\0"
_APP2: Final = 0xE2
_ICC_OF_TIFF: Final = 34675
_COLOR_SPACE: Final = 40961
_EXIF_SRGB, _EXIF_ADOBE = 1, 2
_ADOBE_INDEX: Final = "R03"
_SRGB_GAMMA: Final = 45455
_UNIT: Final = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedSpace:
    """Colours as a file states them.

    Attributes:
        space: None where it states nothing that can be honoured.
        doubt: What it states that cannot be honoured; empty otherwise.
    """

    space: ColorSpace | None = None
    doubt: str = ""

    def of_channels(self, dimensions: int) -> "StatedSpace":
        """Return the space for samples (h, w) or (3, h, w); a doubt for colours in a grey one."""
        space = self.space
        if dimensions == 2 or space is None or space.tables is not None or len(space.curves) == 3:
            return self
        return StatedSpace(doubt=f"the colour profile {space.name!r} of grey for colours")


NOTHING: Final = StatedSpace()


def space_of_jpeg(data: bytes, exif: TiffTags) -> StatedSpace:
    """Return the space of a JPEG: of its profile, else of its Exif."""
    parts: dict[int, bytes] = {}
    count = 0
    for segment in header_segments(data):
        if segment.marker == _APP2 and segment.content.startswith(_ICC_OF_JPEG):
            number, count = segment.content[len(_ICC_OF_JPEG) :][:2] or (0, 0)
            parts[number] = segment.content[len(_ICC_OF_JPEG) + 2 :]
    if not parts:
        return _of_exif(exif)
    if sorted(parts) != list(range(1, count + 1)):
        return StatedSpace(doubt=f"a colour profile of {count} parts, of which it has {len(parts)}")
    return _of_profile(b"".join(parts[number] for number in sorted(parts)))


def space_of_png(data: bytes, exif: TiffTags) -> StatedSpace:
    """Return the space of a PNG by the first of its chunks in the order of the standard."""
    chunks: dict[bytes, bytes] = {}
    for name, content in png_chunks(data):
        chunks.setdefault(name, content)
    try:
        if b"cICP" in chunks:
            return _of_code_points(chunks[b"cICP"])
        if b"iCCP" in chunks:
            packed = chunks[b"iCCP"].partition(b"\0")[2][1:]
            return _of_profile(zlib.decompressobj().decompress(packed, MOST_PROFILE_BYTES + 1))
        if b"sRGB" in chunks:
            return StatedSpace(space=color_space.SRGB)
        if b"gAMA" in chunks or b"cHRM" in chunks:
            return _of_gamma(chunks.get(b"gAMA"), chunks.get(b"cHRM"))
    except (zlib.error, struct.error, ValueError, ZeroDivisionError):
        return StatedSpace(doubt="a colour space that is damaged")
    return _of_exif(exif)


def space_of_tiff(tags: TiffTags) -> StatedSpace:
    """Return the space of a TIFF: of the profile of its first directory that has one, or Exif."""
    for directory in tags.directories:
        profile = directory.get(_ICC_OF_TIFF)
        if isinstance(profile, bytes):
            return _of_profile(profile)
        if profile is not None:
            return _of_profile(bytes(int(n) & 0xFF for n in profile))
    return _of_exif(tags)


def _of_profile(profile: bytes) -> StatedSpace:
    try:
        return StatedSpace(space=space_of_profile(profile))
    except DecodeError as error:
        return StatedSpace(doubt=str(error))


def _of_exif(exif: TiffTags) -> StatedSpace:
    code = (exif.numbers(_COLOR_SPACE) or (None,))[0]
    adobe = code == _EXIF_ADOBE or (exif.interoperability == _ADOBE_INDEX and code != _EXIF_SRGB)
    return StatedSpace(space=color_space.ADOBE_RGB) if adobe else NOTHING


def _of_code_points(content: bytes) -> StatedSpace:
    primaries, curve, matrix, full = struct.unpack(">4B", content)
    named_primaries = color_space.CODE_POINT_PRIMARIES.get(primaries)
    bend = color_space.CODE_POINT_CURVES.get(curve)
    if named_primaries is None or bend is None or matrix != 0 or full != 1:
        points = f"{primaries}/{curve}/{matrix}/{full}"
        return StatedSpace(doubt=f"the code points {points} of H.273 (cICP)")
    name = f"{named_primaries[0]}, {bend[0]} (cICP)"
    return StatedSpace(space=space_of_primaries(name, named_primaries[1], bend[1]))


def _of_gamma(gamma: bytes | None, chromaticities: bytes | None) -> StatedSpace:
    coded = _SRGB_GAMMA if gamma is None else struct.unpack(">I", gamma)[0]
    # what writes 1 / 2.2 means sRGB, as the standard recommends
    is_srgb = abs(coded - _SRGB_GAMMA) <= 1
    curve = color_space.srgb_curve if is_srgb else power_curve(_UNIT / coded)
    white, primaries = D65, REC709_PRIMARIES
    if chromaticities is not None:
        numbers = [n / _UNIT for n in struct.unpack(">8I", chromaticities)]
        white, *rest = zip(numbers[::2], numbers[1::2], strict=True)
        primaries = (rest[0], rest[1], rest[2])
    name = f"gamma {coded / _UNIT:.4g}" + (" with cHRM" if chromaticities else "") + " (gAMA)"
    return StatedSpace(space=space_of_primaries(name, primaries, curve, white))

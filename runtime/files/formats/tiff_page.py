"""The page of a TIFF that is the picture, and what its tags say of its samples.

Cameras and scanners put a thumbnail first, as a page of its own or with the picture in its
children. The picture is the largest page that is not marked as a reduced one or as a mask.

References: TIFF 6.0, sections 3 to 9, 16, 18, 23; TIFF technical note 1 (SubIFDs); Adobe Photoshop
TIFF technical notes (ICCLab, 16-bit Lab).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import MAX_PIXELS
from camkit.runtime.files.tiff_tags import TagValue, TiffTags

MIN_IS_WHITE, MIN_IS_BLACK, RGB, PALETTE, YCBCR, CIE_LAB, ICC_LAB = 0, 1, 2, 3, 6, 8, 9
UNSIGNED, SIGNED, FLOAT, UNDEFINED = 1, 2, 3, 4
PLAIN, LZW, OLD_JPEG, JPEG, DEFLATE, PACK_BITS, OLD_DEFLATE = 1, 5, 6, 7, 8, 32773, 32946
LERC: Final = 34887
ASSOCIATED_ALPHA: Final = 1
LZMA: Final = 34925
READ: Final = (MIN_IS_WHITE, MIN_IS_BLACK, RGB, PALETTE, YCBCR, CIE_LAB, ICC_LAB)
CHANNELS: Final = {MIN_IS_WHITE: 1, MIN_IS_BLACK: 1, PALETTE: 1}
MOST_PX_PER_BYTE: Final = 8192
"""Deflate packs 1032 bytes into one, each of up to 8 pixels."""

_WITHOUT_PREDICTOR: Final = {PACK_BITS: "PackBits", LERC: "LERC"}
_UNREAD_PHOTOMETRICS: Final = {
    4: "a transparency mask",
    5: "inks (CMYK)",
    10: "ITU Lab",
    32803: "a sensor's mosaic (CFA)",
    32844: "LogL of SGI",
    32845: "LogLuv of SGI",
    34892: "linear RAW",
    51177: "a depth map",
}
_OF_THREE: Final = {YCBCR: "YCbCr", CIE_LAB: "Lab", ICC_LAB: "Lab"}
_IMAGE_DEPTH: Final = 32997
_REDUCED, _MASK = 1, 4
_OLD_REDUCED: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class TiffPage:
    """One page.

    Attributes:
        start: Where its directory lies in the file.
        tags: Its directory.
        number: From 1, in the order of the file.
    """

    start: int
    tags: Mapping[int, TagValue]
    number: int

    def numbers(self, tag: int, default: tuple[int, ...] = ()) -> tuple[int, ...]:
        """Return whole numbers of a tag."""
        value = self.tags.get(tag)
        if value is None or isinstance(value, bytes):
            return default
        return tuple(int(n) if abs(n) < 1 << 40 else 0 for n in value)

    def number_of(self, tag: int, default: int) -> int:
        """Return the first number of a tag."""
        return self.numbers(tag, (default,))[0]

    @property
    def size_px(self) -> tuple[int, int]:
        """Return (width, height)."""
        return self.number_of(256, 0), self.number_of(257, 0)

    @property
    def samples(self) -> int:
        """Return the samples of a pixel."""
        return self.number_of(277, 1)

    @property
    def bits(self) -> int:
        """Return the bits of a sample."""
        return self.number_of(258, 1)

    @property
    def kind(self) -> int:
        """Return the kind of a sample's number: UNSIGNED, SIGNED, FLOAT."""
        kind = self.number_of(339, UNSIGNED)
        return UNSIGNED if kind == UNDEFINED else kind

    @property
    def compression(self) -> int:
        """Return the number of its compression."""
        return self.number_of(259, PLAIN)

    @property
    def predictor(self) -> int:
        """Return the number of its predictor."""
        return self.number_of(317, 1)

    @property
    def photometric(self) -> int:
        """Return the meaning of the samples; derived from their number where it is not stated."""
        return self.number_of(262, RGB if self.samples >= 3 else MIN_IS_BLACK)

    @property
    def extra(self) -> tuple[int, ...]:
        """Return the kinds of samples beyond the colours."""
        return self.numbers(338)

    @property
    def is_planar(self) -> bool:
        """Return whether each sample has a plane of its own."""
        return self.number_of(284, 1) == 2 and self.samples > 1

    @property
    def empty_chunks(self) -> int:
        """Return the number of strips or tiles without a place in the file, as sparse ones have."""
        places = ((273, 279), (324, 325))
        pairs = [
            pair
            for one, two in places
            for pair in zip(self.numbers(one), self.numbers(two), strict=False)
        ]
        return sum(pair == (0, 0) for pair in pairs)

    @property
    def colours(self) -> int:
        """Return the samples that are colour: 1 or 3."""
        is_triple = self.samples == 3 or (self.samples > 3 and not self.extra)
        return 3 if is_triple else CHANNELS.get(self.photometric, 3)


def picture_page(tags: TiffTags) -> tuple[TiffPage, tuple[str, ...]]:
    """Return the page that is the picture, and notes on those that are not.

    Raises:
        DecodeError: If no page is one, or it is of a kind that is not read; names it.
    """
    places = zip(tags.starts, tags.directories, strict=True)
    directories = [
        (start, directory) for start, directory in places if {256, 257} <= directory.keys()
    ]
    pages = [
        TiffPage(start=start, tags=directory, number=number)
        for number, (start, directory) in enumerate(directories, 1)
    ]
    if not pages:
        raise DecodeError("the TIFF has no page with a size: it is damaged, copy it again")
    full = [page for page in pages if not _is_beside(page)] or pages
    main = max(full, key=lambda page: page.size_px[0] * page.size_px[1])
    _check(main, tags.file_bytes)
    notes = []
    if main.number > 1:
        wide, high = pages[0].size_px
        first = "a mask or preview" if _is_beside(pages[0]) else "smaller"
        notes.append(
            f"page {main.number} of the TIFF is read; page 1 is {first} ({wide}x{high} px)"
        )
    if main.empty_chunks:
        notes.append(f"{main.empty_chunks} strips or tiles hold no data: their samples are 0")
    if len(full) > 1:
        notes.append(f"one page of the TIFF is read, {len(full) - 1} more are not")
    return main, tuple(notes)


def _is_beside(page: TiffPage) -> bool:
    """Return whether a page is marked as a reduced one or as a mask."""
    return bool(page.number_of(254, 0) & (_REDUCED | _MASK)) or page.number_of(255, 0) == (
        _OLD_REDUCED
    )


def _check(page: TiffPage, file_bytes: int) -> None:
    """Refuse what is not read, by its name."""
    wide, high = page.size_px
    if wide < 1 or high < 1 or wide * high > min(MAX_PIXELS, file_bytes * MOST_PX_PER_BYTE):
        raise DecodeError(f"the header claims {wide}x{high} pixels in {file_bytes} bytes")
    name = _UNREAD_PHOTOMETRICS.get(page.photometric)
    if page.photometric not in READ:
        name = name or f"photometric interpretation {page.photometric}"
        raise DecodeError(f"a TIFF of {name} is not read; save it as grey or RGB")
    bits = set(page.numbers(258))
    if len(bits) > 1:
        raise DecodeError(f"a TIFF of samples of {sorted(bits)} bits is not read; save 8 or 16")
    if page.samples > page.colours + 1:
        raise DecodeError(
            f"a TIFF of {page.samples} samples per pixel is not read; expected 1 or 3, and alpha"
        )
    if page.samples < page.colours:
        name = _OF_THREE.get(page.photometric, "RGB")
        raise DecodeError(f"a TIFF of {name} with {page.samples} of its 3 samples is not read")
    if page.number_of(_IMAGE_DEPTH, 1) > 1:
        raise DecodeError(
            f"a TIFF of {page.number_of(_IMAGE_DEPTH, 1)} layers in depth is not read; save one"
        )
    if page.compression in _WITHOUT_PREDICTOR and page.predictor > 1:
        name = _WITHOUT_PREDICTOR[page.compression]
        raise DecodeError(f"a TIFF of {name} with a predictor is not read: programs disagree on it")
    _check_numbers(page)


def _check_numbers(page: TiffPage) -> None:
    kinds = {SIGNED: "signed integers", 5: "complex integers", 6: "complex floats"}
    if page.photometric in (CIE_LAB, ICC_LAB):
        if page.bits not in (8, 16) or page.kind == FLOAT:
            raise DecodeError(f"a Lab TIFF of {page.bits} bits is not read; save 8 or 16")
        return
    if page.kind in kinds:
        raise DecodeError(f"a TIFF of {kinds[page.kind]} is not read; save unsigned ones or floats")
    if page.kind == FLOAT and page.bits not in (16, 32, 64):
        raise DecodeError(f"a TIFF of floats of {page.bits} bits is not read; save 16 or 32")
    if page.kind != FLOAT and not 1 <= page.bits <= 16:
        raise DecodeError(f"a TIFF of integers of {page.bits} bits is not read; save 16, or floats")
    if page.kind == FLOAT and page.photometric in (MIN_IS_WHITE, PALETTE, YCBCR):
        raise DecodeError("a TIFF of floats is grey (MinIsBlack) or RGB; save it so")
    if page.photometric == PALETTE and page.bits > 8:
        raise DecodeError(f"a palette of {page.bits} bits is not read; save it as RGB")

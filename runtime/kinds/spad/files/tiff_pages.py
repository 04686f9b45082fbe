"""Axes of a stack of TIFF pages by their names, and pages measured before they are unpacked."""

import lzma
import math
import zlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import tifffile

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.files.channels import chosen_places

NAMES: Final = {
    "T": "frame",
    "Z": "slice",
    "C": "channel",
    "H": "bin",
    "I": "page",
    "A": "angle",
    "P": "phase",
    "R": "tile",
    "E": "wavelength",
    "L": "exposure",
    "V": "event",
    "M": "mosaic",
}
"""Letter of an axis, as tifffile has it -> what its places are called."""
TIMES: Final = "HT"
"""Letters that are time wherever they stand, the likelier first."""
LONE: Final = frozenset("HTZIQ")
"""Letters of pages that are time where nothing else is: most programs know no other stack."""
COUNTED: Final = "abcdefghijklmnopqrsuvwz"
"""Letters for axes that a file does not name."""
_UNPACKERS: Final[Mapping[int, Callable[[], Any]]] = {
    8: zlib.decompressobj,
    32946: zlib.decompressobj,
    34925: lzma.LZMADecompressor,
    50013: zlib.decompressobj,
}
"""Packing -> what unpacks it piece by piece, where few bytes become many."""
MOST_TIMES: Final = 10_000
"""So many bytes one packed byte becomes at most."""


def stack_axes(path: Path, letters: str, shape: tuple[int, ...], key: str | None) -> str | None:
    """Return the axes of a stack as a caller would state them; None for pages alone.

    Args:
        path: The file, for errors.
        letters: Of its axes, as tifffile names them, rows and columns last.
        shape: Of the array.
        key: What the caller says of the places to take.

    Raises:
        ContractError: If nothing says which axis is time, or which place of another is meant.
    """
    further = letters[: -len("YX")]
    if not letters.endswith("YX") or (len(further) > 1 and set(further) - set(NAMES)):
        raise ContractError(
            f"{path.name} holds an array of {shape} with axes that it does not name; expected "
            "time, rows and columns: state [array] axes, such as "
            f'"{_example(shape)}" (place 0 of each further axis), in a file for '
            f"{option_text('timing')}"
        )
    time = next((letter for letter in TIMES if letter in further), None)
    if time is None and len(further) == 1 and further in LONE:
        time = further
    if time is None and further and further != "C":
        listed = ", ".join(f"{NAMES[one]} ({n})" for one, n in zip(further, shape, strict=False))
        raise ContractError(
            f"{path.name} holds {listed}, rows and columns: nothing says which axis is time; state "
            f'[array] axes, such as "{_example(shape)}" (place 0 of each further axis), in a file '
            f"for {option_text('timing')}"
        )
    numbers = {NAMES[a]: range(n) for a, n in zip(further, shape, strict=False) if a != time}
    places = chosen_places(path, numbers, key)
    return "".join("t" if a == time else f"{_letter(a)}{places[NAMES[a]]}" for a in further) + "yx"


def _letter(letter: str) -> str:
    """Return a letter for an axis that is none of t, y and x."""
    return "f" if letter == "T" else letter.lower()


def _example(shape: tuple[int, ...]) -> str:
    return "t" + "".join(f"{letter}0" for letter in COUNTED[: max(len(shape) - 3, 0)]) + "yx"


def check_whole(path: Path, file: tifffile.TiffFile) -> None:
    """Refuse a file with other pages than it announces, of which tifffile reads what it finds.

    Raises:
        DecodeError: If it is cut off.
    """
    pixels = sum(math.prod(one.shape) for one in file.series)
    shaped = [math.prod(one.get("shape", ())) for one in file.shaped_metadata or ()]
    images = (file.imagej_metadata or {}).get("images", 0)
    announced = max(sum(shaped), images * math.prod(file.pages[0].shape))
    in_series = sum(len(one) for one in file.series)
    is_mapped = all(one.dataoffset is not None for one in file.series)
    if pixels < announced or (not is_mapped and len(file.pages) != in_series):
        raise DecodeError(
            f"{path.name} is cut off: {max(announced, pixels)} pixels on {in_series} pages are "
            f"announced, {pixels} on {len(file.pages)} pages are there"
        )


def check_pages(path: Path, pages: Iterable[Any], max_bytes: int) -> None:
    """Refuse packed pages that take more memory than there is, or than they say.

    Raises:
        ContractError: If a strip or tile does not fit the memory.
        DecodeError: If one unpacks to more than its pixels.
    """
    for page in pages:
        if page is None or page.compression == 1:
            continue
        piece_bytes = page.dtype.itemsize
        for side in page.chunks:
            piece_bytes *= side
        if piece_bytes > max_bytes:
            raise ContractError(
                f"{path.name} is packed in pieces of {piece_bytes / 1e9:.3g} GB, more than fits "
                f"the memory; raise {option_text('max_mem_bytes')}, or store it as HDF5"
            )
        unpacker = _UNPACKERS.get(int(page.compression))
        for offset, size in zip(page.dataoffsets, page.databytecounts, strict=True):
            if unpacker is None or size * MOST_TIMES <= max_bytes:
                continue
            with path.open("rb") as file:
                file.seek(offset)
                data = unpacker().decompress(file.read(min(size, 2 * max_bytes)), piece_bytes + 1)
            if len(data) > piece_bytes:
                raise DecodeError(
                    f"{path.name} is damaged: a piece of its pixels unpacks to more than the "
                    f"{piece_bytes} bytes that they are"
                )

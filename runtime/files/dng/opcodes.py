"""The opcode lists of a DNG: what each asks for, and what of it is done here.

OpcodeList1   on the stored numbers                  named
OpcodeList2   on linear samples of the mosaic        GainMap applied, others named
OpcodeList3   on the demosaicked picture             GainMap and FixVignetteRadial applied

DNG specification 1.7.1, chapter 7. LibRaw does none of it, but for the curve of lossy JPEG.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from camkit.errors import DecodeError
from camkit.runtime.files.dng.field_gain import FieldGain, GainMap, RadialGain
from camkit.runtime.files.dng.picture_tags import LOSSY_JPEG, DngPicture, octets_of

LISTS: Final = {51008: "OpcodeList1", 51009: "OpcodeList2", 51022: "OpcodeList3"}
NAMES: Final = {
    1: "WarpRectilinear", 2: "WarpFisheye", 3: "FixVignetteRadial", 4: "FixBadPixelsConstant",
    5: "FixBadPixelsList", 6: "TrimBounds", 7: "MapTable", 8: "MapPolynomial", 9: "GainMap",
    10: "DeltaPerRow", 11: "DeltaPerColumn", 12: "ScalePerRow", 13: "ScalePerColumn",
    14: "WarpRectilinear2",
}  # fmt: skip
FIX_VIGNETTE_RADIAL: Final = 3
MAP_POLYNOMIAL: Final = 8
GAIN_MAP: Final = 9
MAX_OPCODES: Final = 1024
_HEAD: Final = struct.Struct(">IIII")


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldGains:
    """Gains of the pixels of a picture that its opcodes ask for.

    Attributes:
        mosaic: Of the mosaic as it is stored, or of planes.
        colours: Of the colours behind the mosaic.
    """

    mosaic: tuple[FieldGain, ...] = ()
    colours: tuple[FieldGain, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.mosaic or self.colours)


def field_gains(picture: DngPicture) -> tuple[FieldGains, list[str]]:
    """Return the gains that the opcodes of a picture ask for, and notes on all opcodes."""
    gains: dict[str, list[FieldGain]] = {"OpcodeList2": [], "OpcodeList3": []}
    notes: list[str] = []
    for tag, list_name in LISTS.items():
        if tag not in picture.directory:
            continue
        missing: list[str] = []
        try:
            for number, data in _opcodes(octets_of(picture.directory, tag)):
                if number == MAP_POLYNOMIAL and picture.compression == LOSSY_JPEG:
                    continue  # the curve of lossy JPEG, which LibRaw applies
                gain = _gain(list_name, number, data, picture)
                if gain is not None:
                    gains[list_name].append(gain)
                else:
                    missing.append(NAMES.get(number, f"opcode {number}"))
        except DecodeError as error:
            gains[list_name] = []
            notes.append(f"{list_name} is not applied, {error}: the header is damaged")
            continue
        if gains.get(list_name):
            most = max(gain.most for gain in gains[list_name])
            names = dict.fromkeys(gain.name for gain in gains[list_name])
            notes.append(f"{' and '.join(names)} of {list_name} applied: gain up to {most:.2f}")
        if missing:
            notes.append(
                f"corrections of {list_name} not applied: {', '.join(dict.fromkeys(missing))}"
            )
    combined = FieldGains(mosaic=tuple(gains["OpcodeList2"]), colours=tuple(gains["OpcodeList3"]))
    return combined, notes


def _opcodes(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield number and data of each opcode.

    Raises:
        DecodeError: If the list ends early or claims more than can be.
    """
    if len(data) < 4:
        raise DecodeError("it is cut off")
    (count,) = struct.unpack_from(">I", data)
    if count > MAX_OPCODES:
        raise DecodeError(f"it claims {count} opcodes")
    at = 4
    for _ in range(count):
        if at + _HEAD.size > len(data):
            raise DecodeError("it is cut off")
        number, _, _, size = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if at + size > len(data):
            raise DecodeError("it is cut off")
        yield number, data[at : at + size]
        at += size


def _gain(list_name: str, number: int, data: bytes, picture: DngPicture) -> FieldGain | None:
    """Return the gain of an opcode that is applied; None for any other."""
    top, left, bottom, right = picture.active_area
    size = bottom - top, right - left
    if number == GAIN_MAP and list_name != "OpcodeList1":
        return GainMap.of_opcode(data, size)
    if number == FIX_VIGNETTE_RADIAL and list_name == "OpcodeList3":
        return RadialGain.of_opcode(data, size)
    return None

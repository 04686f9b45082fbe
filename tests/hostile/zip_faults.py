"""Faults of the zip: changed bytes, and headers that say something else than the directory."""

import struct

from tests.hostile.decisions import Decisions

_MAGICS = (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06")
_HEADER_BYTES = (30, 46, 22)
_ODD_WORDS = (0, 1, 8, 9, 0x7FFF, 0x8000, 0xFFFF, 99)


def changed_bytes(data: bytes, choose: Decisions) -> bytes:
    """Change, cut out or put in a few bytes anywhere."""
    made = bytearray(data)
    for _ in range(1 + choose.index(4)):
        at = int.from_bytes(choose.raw(4), "little") % max(len(made), 1)
        match choose.index(5):
            case 0:
                made[at : at + 1] = choose.raw(1)
            case 1:
                made[at : at + 1] = bytes([made[at] ^ (1 << choose.index(8))]) if made else b""
            case 2:
                del made[at : at + 1 + choose.index(200)]
            case 3:
                made[at:at] = choose.raw(1 + choose.index(8))
            case _:
                del made[at:]
    return bytes(made)


def changed_header(data: bytes, choose: Decisions) -> bytes:
    """Write odd words into a header of the zip, or put its members into one another."""
    made = bytearray(data)
    for _ in range(1 + choose.index(3)):
        kind = choose.index(len(_MAGICS))
        places = _places(made, _MAGICS[kind])
        if not places:
            continue
        at = choose.pick(places)
        field = at + 4 + choose.index(_HEADER_BYTES[kind] - 5)
        word = choose.pick(_ODD_WORDS) if choose.coin() else struct.unpack("<H", choose.raw(2))[0]
        made[field : field + 2] = struct.pack("<H", word)
    if choose.index(8) == 1:  # one member's place becomes that of another
        places = _places(made, _MAGICS[1])
        if len(places) > 1:
            one, other = choose.pick(places), choose.pick(places)
            made[one + 42 : one + 46] = made[other + 42 : other + 46]
    return bytes(made)


def _places(data: bytes | bytearray, magic: bytes) -> list[int]:
    found, at = [], data.find(magic)
    while at >= 0 and len(found) < 64:
        found.append(at)
        at = data.find(magic, at + 1)
    return found

"""DNG files of any kind, byte by byte: what no writer at hand makes, as phones and programs do.

    build_dng(path, samples, {50729: ("rational", (0.3457, 0.3585))}, compression=8, predictor=3)

Every file is one directory. Tags given by the caller replace those of the sound default.
"""

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

CFA, LINEAR_RAW = 32803, 34892
DEFLATE: Final = 8
MILLION: Final = 10**6

TagSpec = tuple[str, Any]
_CODES: Final = {
    "byte": (1, "B"), "ascii": (2, "s"), "short": (3, "H"), "long": (4, "I"),
    "rational": (5, "II"), "opaque": (7, "s"), "srational": (10, "ii"), "float": (11, "f"),
    "double": (12, "d"),
}  # fmt: skip
IDENTITY: Final = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def build_dng(
    path: Path,
    samples: NDArray[Any],
    tags: Mapping[int, TagSpec | None] | None = None,
    *,
    compression: int = 1,
    predictor: int = 1,
    chunk: tuple[int, int] | None = None,
    rows_per_strip: int | None = None,
    bits: int | None = None,
    order: str = "<",
    pieces: Sequence[bytes] | None = None,
) -> Path:
    """Write a DNG and return its path.

    Args:
        path: The file.
        samples: (h, w) mosaic or (h, w, c) planes; float samples become float16, 24 or 32.
        tags: Number -> (type, values) beside the usual ones; None leaves a usual tag out.
        compression: 1 or 8; any other number only names what the bytes are not.
        predictor: TIFF 2, 3 or DNG 34892..34895 before Deflate.
        chunk: (height, width) of tiles; None for strips.
        rows_per_strip: Rows of a strip; None for all.
        bits: Of a sample; None for those of the type.
        order: "<" or ">".
        pieces: Bytes of the strips, in place of those of the samples.
    """
    planes = 1 if samples.ndim == 2 else samples.shape[2]
    depth = bits or samples.dtype.itemsize * 8
    height, width = samples.shape[:2]
    tall, wide = chunk or (rows_per_strip or height, width)
    pieces = pieces or [
        _packed(_piece(samples, (top, left), (tall, wide), whole=chunk is not None), depth, order,
                predictor, compression)
        for top in range(0, height, tall)
        for left in range(0, width, wide)
    ]  # fmt: skip
    usual = _usual(samples, planes, depth, compression, predictor)
    where = (324, 325) if chunk else (273, 279)
    usual |= {322: ("long", (wide,)), 323: ("long", (tall,))} if chunk else {278: ("long", (tall,))}
    usual[where[0]] = ("long", tuple(range(len(pieces))))
    usual[where[1]] = ("long", tuple(len(piece) for piece in pieces))
    final = {n: spec for n, spec in (usual | dict(tags or {})).items() if spec is not None}
    path.write_bytes(_file(final, pieces, where[0], order))
    return path


def opcode_list(*opcodes: tuple[int, bytes] | tuple[int, bytes, int]) -> TagSpec:
    """Return a tag of opcodes (number, data, flags), big-endian as DNG has them."""
    parts = [
        struct.pack(">IIII", number, 0x01030000, flags[0] if flags else 0, len(data)) + data
        for number, data, *flags in opcodes
    ]
    return "opaque", struct.pack(">I", len(parts)) + b"".join(parts)


def gain_map(
    gains: NDArray[Any],
    area: Sequence[int],
    *,
    plane: tuple[int, int] = (0, 1),
    pitch: tuple[int, int] = (1, 1),
    spacing: tuple[float, float] | None = None,
    origin: tuple[float, float] = (0.0, 0.0),
) -> bytes:
    """Return the data of opcode 9: gains (v, h) or (v, h, planes) over the whole picture."""
    grid = gains if gains.ndim == 3 else gains[..., None]
    v, h, planes = grid.shape
    steps = spacing or (1 / max(v - 1, 1), 1 / max(h - 1, 1))
    head = struct.pack(">4I4I2I", *area, *plane, *pitch, v, h)
    place = struct.pack(">4dI", *steps, *origin, planes)
    return head + place + grid.astype(">f4").tobytes()


def _usual(
    samples: NDArray[Any], planes: int, depth: int, compression: int, predictor: int
) -> dict[int, TagSpec]:
    floats = samples.dtype.kind == "f"
    usual: dict[int, TagSpec] = {
        254: ("long", (0,)),
        256: ("long", (samples.shape[1],)),
        257: ("long", (samples.shape[0],)),
        258: ("short", (depth,) * planes),
        259: ("short", (compression,)),
        262: ("short", (CFA if samples.ndim == 2 else LINEAR_RAW,)),
        271: ("ascii", b"Test\0"),
        272: ("ascii", b"Cam\0"),
        274: ("short", (1,)),
        277: ("short", (planes,)),
        284: ("short", (1,)),
        50706: ("byte", (1, 4, 0, 0)),
        50708: ("ascii", b"Test Cam\0"),
        50717: ("long", (1 if floats else 4095,) * planes),
        50721: ("srational", IDENTITY),
        50728: ("rational", (0.5, 1.0, 0.625)),
        50778: ("short", (21,)),
    }
    if floats:
        usual[339] = ("short", (3,) * planes)
    else:
        usual[50714] = ("long", (256,) * planes)
    if predictor != 1:
        usual[317] = ("short", (predictor,))
    if samples.ndim == 2:
        usual[33421] = ("short", (2, 2))
        usual[33422] = ("byte", (0, 1, 1, 2))
    return usual


def _piece(
    samples: NDArray[Any], place: tuple[int, int], size: tuple[int, int], *, whole: bool
) -> NDArray[Any]:
    """Return (rows, columns, planes) of a strip or tile, a tile filled up with its edge."""
    part = samples[place[0] : place[0] + size[0], place[1] : place[1] + size[1]]
    part = part.reshape(*part.shape[:2], -1)
    if not whole:
        return part
    return np.pad(part, [(0, full - n) for full, n in zip(size, part.shape[:2], strict=True)]
                  + [(0, 0)], mode="edge")  # fmt: skip


def _packed(part: NDArray[Any], depth: int, order: str, predictor: int, compression: int) -> bytes:
    """Return the bytes of a piece."""
    octets = _octets(part, depth)  # (rows, columns * planes, bytes), the highest first
    stride = part.shape[2] * {34892: 2, 34893: 4, 34894: 2, 34895: 4}.get(predictor, 1)
    if predictor in (3, 34894, 34895):
        rows = np.swapaxes(octets, 1, 2).reshape(len(octets), -1)
        data = np.concatenate([rows[:, :stride], rows[:, stride:] - rows[:, :-stride]], axis=1)
    else:
        if predictor != 1:
            kind = np.dtype(f">u{depth // 8}")
            rows = np.ascontiguousarray(octets).view(kind)[..., 0].astype(kind.newbyteorder("="))
            rows[:, stride:] -= rows[:, :-stride].copy()
            octets = rows.astype(kind)[..., None].view(np.uint8)
        data = octets if order == ">" else octets[..., ::-1]
    raw = np.ascontiguousarray(data).tobytes()
    return zlib.compress(raw) if compression in (DEFLATE, 32946) else raw


def _octets(part: NDArray[Any], depth: int) -> NDArray[np.uint8]:
    rows = part.reshape(len(part), -1)
    if part.dtype.kind != "f":
        return rows.astype(f">u{depth // 8}")[..., None].view(np.uint8)
    if depth == 24:
        return _float24(rows)
    return rows.astype(f">f{depth // 8}")[..., None].view(np.uint8)


def _float24(rows: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of DNG's float24: sign, 7 bits of exponent (bias 63), 16 of mantissa."""
    mantissa, exponent = np.frexp(np.abs(rows).astype(np.float64))
    whole = np.where(mantissa > 0, np.floor((2 * mantissa - 1) * 65536), 0).astype(np.uint32)
    power = np.where(mantissa > 0, exponent - 1 + 63, 0).astype(np.uint32)
    word = (np.signbit(rows).astype(np.uint32) << 23) | (power << 16) | whole
    return word.astype(">u4")[..., None].view(np.uint8)[..., 1:]


def _file(tags: Mapping[int, TagSpec], pieces: Sequence[bytes], where: int, order: str) -> bytes:
    first = 8 + 2 + 12 * len(tags) + 4
    room = sum(_size(spec) + 8 for spec in tags.values())
    starts, at = [], first + room
    for piece in pieces:
        starts.append(at)
        at += len(piece) + len(piece) % 2
    entries, values = b"", b""
    for number, spec in sorted(tags.items()):
        kind, data, count = _value((spec[0], tuple(starts)) if number == where else spec, order)
        if len(data) > 4:
            place = first + len(values)
            values += data + b"\0" * (-len(data) % 4)
            data = struct.pack(order + "I", place)
        entries += struct.pack(order + "HHI", number, kind, count) + data.ljust(4, b"\0")
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8)
    body = head + struct.pack(order + "H", len(tags)) + entries + bytes(4) + values
    return body.ljust(first + room, b"\0") + b"".join(p + b"\0" * (len(p) % 2) for p in pieces)


def _size(spec: TagSpec) -> int:
    return len(_value(spec, "<")[1])


def _value(spec: TagSpec, order: str) -> tuple[int, bytes, int]:
    kind, values = spec
    number, code = _CODES[kind]
    if code == "s":
        return number, bytes(values), len(values)
    if len(code) == 2:
        numbers = [n for value in values for n in _ratio(value)]
        return number, struct.pack(f"{order}{len(numbers)}{code[0]}", *numbers), len(values)
    return number, struct.pack(f"{order}{len(values)}{code}", *values), len(values)


def _ratio(value: float) -> tuple[int, int]:
    return (round(value * MILLION), MILLION) if math.isfinite(value) else (0, 0)

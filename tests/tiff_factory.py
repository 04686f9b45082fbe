"""TIFF files byte by byte, for kinds that no library here writes."""

import struct
import zlib

import numpy as np


def pack(rows, bits):
    """Pack (row, value) into rows of whole bytes, high bits first."""
    values = np.asarray(rows, dtype=np.uint32)
    stream = (values[..., None] >> np.arange(bits - 1, -1, -1, dtype=np.uint32)) & 1
    return np.packbits(stream.reshape(len(values), -1).astype(np.uint8), axis=1)


def packed_segments(planes, bits, *, rows=None, tile=None):
    """Return packed strips or tiles of (plane, h, w, sample); 16 bits with the low byte first."""
    _, high, wide, _ = planes.shape
    found = []
    for plane in planes:
        if tile is None:
            step = rows or high
            parts = [plane[top : top + step] for top in range(0, high, step)]
        else:
            below, beside = (-side % part for side, part in zip((high, wide), tile, strict=True))
            padded = np.pad(plane, ((0, below), (0, beside), (0, 0)))
            parts = [
                padded[top : top + tile[0], left : left + tile[1]]
                for top in range(0, high, tile[0])
                for left in range(0, wide, tile[1])
            ]
        flat = [part.reshape(len(part), -1) for part in parts]
        found += [
            part.astype("<u2").tobytes() if bits == 16 else pack(part, bits).tobytes()
            for part in flat
        ]
    return found


def write_tiff(path, pages, *, order="<", big=False):
    """Write pages: each (tags, segments), tags as number -> (type, values); tiles if 322 is there.

    A page whose tags hold 330 as None has all further pages as its children.
    """
    at = 16 if big else 8
    pointer, count_code = ("Q", "Q") if big else ("I", "H")
    body, places = b"", []
    for _, segments in pages:
        offsets = []
        for segment in segments:
            offsets.append(at + len(body))
            body += segment
        places.append(offsets)
    has_children = any(330 in tags for tags, _ in pages)
    starts, directories = [], b""
    base = at + len(body)
    sizes = []
    for (tags, segments), offsets in zip(pages, places, strict=True):
        own = _with_segments(tags, segments, offsets, pointer)
        sizes.append(len(_directory(own, 0, 0, order, pointer, count_code)))
    for number, _ in enumerate(pages):
        starts.append(base + sum(sizes[:number]))
    for number, ((tags, segments), offsets) in enumerate(zip(pages, places, strict=True)):
        own = _with_segments(tags, segments, offsets, pointer)
        if 330 in own:
            own[330] = ("I", starts[1:])
        last = has_children or number + 1 == len(pages)
        following = 0 if last else starts[number + 1]
        directories += _directory(own, starts[number], following, order, pointer, count_code)
    magic = struct.pack(
        order + ("HHHQ" if big else "HI"), *((43, 8, 0) if big else (42,)), starts[0]
    )
    path.write_bytes((b"II" if order == "<" else b"MM") + magic + body + directories)
    return path


def _with_segments(tags, segments, offsets, pointer):
    places = (324, 325) if 322 in tags else (273, 279)
    lengths = [len(segment) for segment in segments]
    return dict(tags) | {places[0]: (pointer, offsets), places[1]: ("I", lengths)}


def _directory(tags, start, following, order, pointer, count_code):
    kinds = {"B": 1, "s": 2, "H": 3, "I": 4, "Q": 16, "u": 7, "f": 11}
    room = struct.calcsize("<" + pointer)
    entries, beyond = b"", b""
    end = start + struct.calcsize("<" + count_code) + len(tags) * (4 + 2 * room) + room
    for tag, (code, values) in sorted(tags.items()):
        if code in "su":
            data, count = bytes(values), len(values)
        else:
            each = [0] if values is None else np.atleast_1d(values).tolist()
            data, count = struct.pack(f"{order}{len(each)}{code}", *each), len(each)
        entries += struct.pack(order + "HH" + pointer, tag, kinds[code], count)
        if len(data) <= room:
            entries += data.ljust(room, b"\0")
        else:
            entries += struct.pack(order + pointer, end + len(beyond))
            beyond += data + b"\0" * (len(data) % 2)
    number = struct.pack(order + count_code, len(tags))
    return number + entries + struct.pack(order + pointer, following) + beyond


def packed_page(samples, bits, *, rows=None, tile=None, photometric=None, planar=False, **more):
    """Return tags and segments of (h, w) or (h, w, sample) packed samples."""
    shaped = samples[..., None] if samples.ndim == 2 else samples
    high, wide, each = shaped.shape
    planes = np.moveaxis(shaped, -1, 0)[..., None] if planar else shaped[None]
    segments = packed_segments(planes, bits, rows=rows, tile=tile)
    if more.get("reverse"):
        table = np.packbits(np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], 1)[:, ::-1], 1)
        segments = [table.ravel()[np.frombuffer(s, np.uint8)].tobytes() for s in segments]
    if more.get("deflate"):
        segments = [zlib.compress(segment) for segment in segments]
    tags = {
        256: ("I", wide),
        257: ("I", high),
        258: ("H", [bits] * each),
        259: ("H", 8 if more.get("deflate") else 1),
        262: ("H", (2 if each == 3 else 1) if photometric is None else photometric),
        266: ("H", 2 if more.get("reverse") else 1),
        277: ("H", each),
        284: ("H", 2 if planar else 1),
    }
    tags |= {322: ("I", tile[1]), 323: ("I", tile[0])} if tile else {278: ("I", rows or high)}
    return tags | more.get("tags", {}), segments

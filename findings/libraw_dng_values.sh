#!/usr/bin/env bash
# Three valid DNGs that LibRaw 0.22 (rawpy 0.28.0) decodes to other numbers, without an error.
#
# 1. A float DNG is scaled to 14 bits by max(WhiteLevel, largest sample): one lamp of 16 makes all
#    else of the picture 16 times darker, though the white level says 16383 either way.
# 2. Float Deflate without a predictor (TIFF tag 317 absent) is decoded as if it had predictor 3:
#    the samples are scrambled.
# 3. Orientation 0, which programs write that do not know it, is taken for a quarter turn (flip 5).
#
# Seen with rawpy 0.28.0, numpy 2.4.6:
#     medians of one scene with a peak of 1 and of 16: 4914 and 307
#     deflated floats of 0.3 and 0.6 come out as 21 levels: 0 1 2 3 6 7 ...
#     flip of orientation 1 and 0: 0 and 5
# Exits 1 if any of them changes.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet rawpy==0.28.0 numpy==2.4.6
venv/bin/python - <<'PYTHON'
import struct
import sys
import zlib

import numpy as np
import rawpy


def write(name, samples, compression=1, orientation=1):
    """Write one strip of a little-endian Bayer DNG."""
    bits, kind = samples.dtype.itemsize * 8, 3 if samples.dtype.kind == "f" else 1
    data = samples.tobytes()
    data = zlib.compress(data) if compression == 8 else data
    height, width = samples.shape
    white = 1 if kind == 3 else 4095
    matrix = [n for v in (1, 0, 0, 0, 1, 0, 0, 0, 1) for n in (v, 1)]
    tags = [
        (254, "I", [0]), (256, "I", [width]), (257, "I", [height]), (258, "H", [bits]),
        (259, "H", [compression]), (262, "H", [32803]), (273, "I", [0]), (274, "H", [orientation]),
        (277, "H", [1]), (278, "I", [height]), (279, "I", [len(data)]), (339, "H", [kind]),
        (33421, "H", [2, 2]), (33422, "B", [0, 1, 1, 2]), (50706, "B", [1, 4, 0, 0]),
        (50708, "s", b"Test\0"), (50717, "I", [white]), (50721, "i", matrix),
        (50778, "H", [21]),
    ]
    codes = {"B": 1, "s": 2, "H": 3, "I": 4, "i": 10}
    values_at = 8 + 2 + 12 * len(tags) + 4
    values, entries = b"", b""
    start = values_at + 256
    for number, code, numbers in tags:
        numbers = [start] if number == 273 else numbers
        raw = numbers if code == "s" else struct.pack(f"<{len(numbers)}{code}", *numbers)
        count = len(numbers) // (2 if code == "i" else 1)
        if len(raw) > 4:
            place = struct.pack("<I", values_at + len(values))
            values += raw + b"\0" * (-len(raw) % 4)
        else:
            place = raw.ljust(4, b"\0")
        entries += struct.pack("<HHI", number, codes[code], count) + place
    head = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + entries + bytes(4) + values
    with open(name, "wb") as file:
        file.write(head.ljust(start, b"\0") + data)


def read(name):
    with rawpy.imread(name) as raw:
        return raw.raw_image_visible.copy(), raw.sizes.flip


scene = np.full((64, 64), 0.3, dtype=np.float32)
scene[0, 0] = 1
write("one.dng", scene)
scene[0, 0] = 16
write("many.dng", scene)
one, many = (float(np.median(read(name)[0])) for name in ("one.dng", "many.dng"))
print(f"medians of one scene with a peak of 1 and of 16: {one:.0f} and {many:.0f}")

flat = np.full((64, 64), 0.3, dtype=np.float16)
flat[::2] = 0.6
write("deflated.dng", flat, compression=8)
deflated = read("deflated.dng")[0]
levels = np.unique(deflated)
print(f"deflated floats of 0.3 and 0.6 come out as {levels.size} levels: {levels[:6]}")

grey = np.tile(np.arange(1000, 1064, dtype=np.uint16), (48, 1))
flips = []
for orientation in (1, 0):
    write("turned.dng", grey, orientation=orientation)
    flips.append(read("turned.dng")[1])
print(f"flip of orientation 1 and 0: {flips[0]} and {flips[1]}")

as_seen = one > 10 * many and levels.size > 2 and flips == [0, 5]
sys.exit(0 if as_seen else 1)
PYTHON

#!/usr/bin/env bash
# A valid linear DNG that LibRaw 0.22 (rawpy 0.28.0) decodes to other numbers, without an error.
#
# 1. Planes that lie apart (PlanarConfiguration 2, uncompressed) are read as if they were
#    interleaved: three planes of 1000, 2000 and 3000 come out mixed.
# 2. Where BlackLevel differs between planes, the white level that LibRaw states is not
#    WhiteLevel: it is larger by what the black of the first plane exceeds the least one.
#
# Seen with rawpy 0.28.0, numpy 2.4.6:
#     one strip for all: 1000 2000 3000; a strip of each plane: 1000 1000 1000
#     white of 4095 with blacks 256 300 200: 4151; with blacks 256 256 256: 4095
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

import numpy as np
import rawpy

HIGH, WIDE = 128, 160
CODES = {1: "B", 2: "s", 3: "H", 4: "I"}
LEVELS = (1000, 2000, 3000)


def write(name, apart, blacks):
    planes = [np.full((HIGH, WIDE), level, "<u2") for level in LEVELS]
    strips = [p.tobytes() for p in planes] if apart else [np.dstack(planes).tobytes()]
    starts, at = [], 8
    for strip in strips:
        starts.append(at)
        at += len(strip)
    tags = {
        254: (4, [0]), 256: (4, [WIDE]), 257: (4, [HIGH]), 258: (3, [16] * 3), 259: (3, [1]),
        262: (3, [34892]), 271: (2, b"Test\0"), 272: (2, b"Cam\0"), 273: (4, starts),
        274: (3, [1]), 277: (3, [3]), 278: (4, [HIGH]), 279: (4, [len(s) for s in strips]),
        284: (3, [2 if apart else 1]), 50706: (1, [1, 4, 0, 0]), 50708: (2, b"Test Cam\0"),
        50714: (4, blacks), 50717: (4, [4095] * 3),
    }
    entries, values, room = b"", b"", at + 2 + 12 * len(tags) + 4
    for tag, (kind, data) in sorted(tags.items()):
        raw = data if kind == 2 else struct.pack(f"<{len(data)}{CODES[kind]}", *data)
        place = raw.ljust(4, b"\0")
        if len(raw) > 4:
            place = struct.pack("<I", room + len(values))
            values += raw + b"\0" * (len(raw) % 2)
        entries += struct.pack("<HHI", tag, kind, len(data)) + place
    with open(name, "wb") as file:
        file.write(struct.pack("<2sHI", b"II", 42, at) + b"".join(strips))
        file.write(struct.pack("<H", len(tags)) + entries + bytes(4) + values)


def read(name):
    with rawpy.imread(name) as raw:
        return raw.raw_image_visible[9, 9, :3].tolist(), raw.white_level


found = []
for apart, blacks in ((False, (256, 256, 256)), (True, (256, 256, 256)), (False, (256, 300, 200))):
    write("x.dng", apart, blacks)
    found.append(read("x.dng"))
    print("planes apart" if apart else "interleaved", blacks, *found[-1])
(one, white), (mixed, _), (_, moved) = found
same = one == list(LEVELS) and mixed != list(LEVELS) and white == 4095 and moved == 4151
sys.exit(0 if same else 1)
PYTHON

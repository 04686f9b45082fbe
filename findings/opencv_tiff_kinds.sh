#!/usr/bin/env bash
# OpenCV 5.0.0.93 (opencv-python-headless), imdecode with IMREAD_UNCHANGED: five kinds of valid TIFF
# give other samples than the file holds, without an error or a warning.
#
# A reader that asks for unchanged samples would expect them unchanged. What comes instead:
# - separate planes (PlanarConfiguration 2), 16-bit RGB: samples from wrong places;
# - MinIsWhite: inverted with 8 bits, not inverted with 16, so one picture is its own negative;
# - 12 bits packed: every sample times 16, and the dtype does not tell;
# - 8-bit RGBA with unassociated alpha: colours multiplied by alpha, though with 16 bits they are not.
#
# Output seen:
#   planar 16-bit RGB: differs
#   MinIsWhite 8-bit: inverted
#   MinIsWhite 16-bit: as stored
#   packed 12-bit: factor 16
#   RGBA 8-bit, alpha 0: colours become 0
#   RGBA 16-bit, alpha 0: colours as stored
set -euo pipefail
cd "$(mktemp -d)"
python3 -m venv venv
venv/bin/pip install --quiet numpy==2.4.6 tifffile==2026.3.3 opencv-python-headless==5.0.0.93
cat > seen.py <<'PY'
import struct

import cv2
import numpy as np
import tifffile

RNG = np.random.default_rng(0)
DEEP = RNG.integers(1, 65535, (24, 32, 3), dtype=np.uint16)
EIGHT = RNG.integers(1, 255, (24, 32, 3), dtype=np.uint8)


def decode(name):
    data = np.frombuffer(open(name, "rb").read(), np.uint8)
    found = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


tifffile.imwrite("planar.tif", DEEP.transpose(2, 0, 1).copy(), photometric="rgb", planarconfig=2)
assert np.array_equal(tifffile.imread("planar.tif"), DEEP.transpose(2, 0, 1))
same = np.array_equal(decode("planar.tif")[..., ::-1], DEEP)
print("planar 16-bit RGB:", "as stored" if same else "differs")

for name, grey in (("8", EIGHT[..., 0]), ("16", DEEP[..., 0])):
    tifffile.imwrite("white.tif", grey, photometric="miniswhite")
    found = decode("white.tif")
    inverted = np.array_equal(found, np.iinfo(grey.dtype).max - grey)
    stored = np.array_equal(found, grey)
    print(f"MinIsWhite {name}-bit:", "inverted" if inverted else "as stored" if stored else "else")

samples = np.arange(24 * 32).reshape(24, 32) % 4096 + 1
bits = (samples[..., None] >> np.arange(11, -1, -1)) & 1
strip = np.packbits(bits.reshape(24, -1).astype(np.uint8), axis=1).tobytes()
tags = [(256, 32), (257, 24), (258, 12), (259, 1), (262, 1), (273, 8), (277, 1), (278, 24),
        (279, len(strip))]
entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
with open("packed.tif", "wb") as file:
    file.write(struct.pack("<2sHI", b"II", 42, 8 + len(strip)) + strip)
    file.write(struct.pack("<H", len(tags)) + entries + bytes(4))
print("packed 12-bit: factor", *np.unique(decode("packed.tif") // samples))

for name, colours in (("8", EIGHT), ("16", DEEP)):
    four = np.dstack([colours, np.zeros((24, 32), colours.dtype)])
    tifffile.imwrite("alpha.tif", four, photometric="rgb", extrasamples=["unassalpha"])
    found = decode("alpha.tif")[..., 2::-1]
    stored = np.array_equal(found, colours)
    print(f"RGBA {name}-bit, alpha 0: colours", "as stored" if stored else f"become {found.max()}")
PY
venv/bin/python seen.py 2>&1 | tee seen.txt
diff seen.txt - <<'SEEN'
planar 16-bit RGB: differs
MinIsWhite 8-bit: inverted
MinIsWhite 16-bit: as stored
packed 12-bit: factor 16
RGBA 8-bit, alpha 0: colours become 0
RGBA 16-bit, alpha 0: colours as stored
SEEN

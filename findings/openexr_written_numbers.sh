#!/usr/bin/env bash
# OpenEXR 3.5.3 (the Python package of the Academy Software Foundation): two ways in which a file
# holds other numbers than were handed over; nothing raises or warns.
#
# 1. OutputFile cuts chromaticities to whole numbers, also those of a header that InputFile has just
#    read. Those of ACEScg become zeros; of ACES 2065-1 only the 1 of green is left. Whoever copies a
#    picture with its header loses its colour space, and a reader that skips what cannot be takes the
#    picture for Rec.709.
# 2. File takes an array for its bytes in memory, whatever its strides are: a crop of the left half
#    holds the first rows of the whole picture, folded; the plane of one colour, samples of all three.
#
# Output seen:
#   ACEScg       by File 0.7130 0.2930 0.1650 0.8300 0.1280 0.0440 0.3217 0.3377
#   ACEScg       copied  0.0000 0.0000 0.0000 0.0000 0.0000 0.0000 0.0000 0.0000
#   ACES 2065-1  by File 0.7347 0.2653 0.0000 1.0000 0.0001 -0.0770 0.3217 0.3377
#   ACES 2065-1  copied  0.0000 0.0000 0.0000 1.0000 0.0000 0.0000 0.0000 0.0000
#   left half, first two rows: 0 1 2 and 3 4 5 for 0 1 2 and 6 7 8
#   red of pixels: 0 1 2 3 for 0 3 6 9
# What the product does: it writes the eight numbers into the file itself (runtime/output/exr.py),
# says where a file has them cut (tests/runtime/files/formats/test_exr_picture.py), and hands over
# arrays in one piece.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet OpenEXR==3.5.3 numpy==2.4.6
cat > seen.py <<'PY'
import numpy as np
import OpenEXR

SPACES = {
    "ACEScg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),
    "ACES 2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
}
GREY = np.full((4, 6), 0.5, np.float32)


def stated(name):
    with OpenEXR.File(name) as file:
        return " ".join(f"{value:.4f}" for value in file.header()["chromaticities"])


def written(plane):
    """Write a plane, and return it as it is read again."""
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"Y": plane}).write("plane.exr")
    with OpenEXR.File("plane.exr") as file:
        return file.channels()["Y"].pixels.copy()


def row(values):
    return " ".join(f"{value:.0f}" for value in values)


for name, points in SPACES.items():
    OpenEXR.File({"chromaticities": points}, {"Y": GREY}).write("first.exr")
    copy = OpenEXR.OutputFile("copy.exr", OpenEXR.InputFile("first.exr").header())
    copy.writePixels({"Y": GREY.tobytes()})
    copy.close()
    print(f"{name:12} by File {stated('first.exr')}")
    print(f"{name:12} copied  {stated('copy.exr')}")

left = np.arange(24, dtype=np.float32).reshape(4, 6)[:, :3]
folded = written(left)
print(f"left half, first two rows: {row(folded[0])} and {row(folded[1])} "
      f"for {row(left[0])} and {row(left[1])}")
assert np.array_equal(written(left.copy()), left)
pixels = np.arange(72, dtype=np.float32).reshape(6, 4, 3)
print(f"red of pixels: {row(written(pixels[..., 0])[0])} for {row(pixels[0, :, 0])}")
PY
venv/bin/python seen.py 2>&1 | tee seen.txt
diff seen.txt - <<'SEEN'
ACEScg       by File 0.7130 0.2930 0.1650 0.8300 0.1280 0.0440 0.3217 0.3377
ACEScg       copied  0.0000 0.0000 0.0000 0.0000 0.0000 0.0000 0.0000 0.0000
ACES 2065-1  by File 0.7347 0.2653 0.0000 1.0000 0.0001 -0.0770 0.3217 0.3377
ACES 2065-1  copied  0.0000 0.0000 0.0000 1.0000 0.0000 0.0000 0.0000 0.0000
left half, first two rows: 0 1 2 and 3 4 5 for 0 1 2 and 6 7 8
red of pixels: 0 1 2 3 for 0 3 6 9
SEEN

#!/usr/bin/env bash
# OpenEXR 3.5.3 (the Python package of the Academy Software Foundation), OutputFile.writePixels: of a
# channel that is subsampled by 2 (RY and BY of luminance and chroma), only every second row that is
# handed over reaches the file, at the place of the row before it. The call checks the number of
# bytes, takes them and raises nothing; File of the same package cannot write such channels at all.
#
# One would expect row n of the chroma to be row n of the file. Two scanlines of the picture at a
# time, with one row of chroma each, come out right.
#
# Output seen:
#   all at once: the first rows of the file are rows 0, 2, 4, 6 of what was written
#   two scanlines at a time: the first rows of the file are rows 0, 1, 2, 3 of what was written
set -euo pipefail
cd "$(mktemp -d)"
python3 -m venv venv
venv/bin/pip install --quiet numpy==2.4.6 OpenEXR==3.5.3
cat > seen.py <<'PY'
import Imath
import numpy as np
import OpenEXR

HIGH, WIDE = 16, 8
LUMA = np.ones((HIGH, WIDE), np.float32)
CHROMA = np.repeat(np.arange(HIGH // 2, dtype=np.float32)[:, None], WIDE // 2, axis=1)
FLOAT = Imath.PixelType(Imath.PixelType.FLOAT)


def write(name, rows_at_once):
    header = OpenEXR.Header(WIDE, HIGH)
    header["channels"] = {
        "Y": Imath.Channel(FLOAT),
        "RY": Imath.Channel(FLOAT, 2, 2),
        "BY": Imath.Channel(FLOAT, 2, 2),
    }
    file = OpenEXR.OutputFile(name, header)
    for top in range(0, HIGH, rows_at_once):
        rows = CHROMA[top // 2 : (top + rows_at_once) // 2].tobytes()
        luma = LUMA[top : top + rows_at_once].tobytes()
        file.writePixels({"Y": luma, "RY": rows, "BY": rows}, rows_at_once)
    file.close()


for told, rows_at_once in (("all at once", HIGH), ("two scanlines at a time", 2)):
    write("chroma.exr", rows_at_once)
    with OpenEXR.File("chroma.exr", separate_channels=True) as file:
        found = np.array(file.channels()["RY"].pixels)
    first = ", ".join(f"{n:.0f}" for n in found[: HIGH // 4, 0])
    print(f"{told}: the first rows of the file are rows {first} of what was written")
PY
venv/bin/python seen.py 2>&1 | tee seen.txt
diff seen.txt - <<'SEEN'
all at once: the first rows of the file are rows 0, 2, 4, 6 of what was written
two scanlines at a time: the first rows of the file are rows 0, 1, 2, 3 of what was written
SEEN

#!/usr/bin/env bash
# OpenCV 5.0.0.93 (opencv-python-headless), remap with float maps: at which place a picture is
# sampled depends on how many channels it has, on its type and on the interpolation.
#
# Version 4.11.0.86, by the same script, rounds all places to 1/32 px. 5.0 takes them exactly with
# INTER_LINEAR for 1, 3 and 4 channels of uint16 or float32, but rounds them for 2 channels (a
# dual-pixel or stereo pair, two planes of chroma, a flow), for 5 and for float64. With INTER_CUBIC
# they are exact, with INTER_LANCZOS4 rounded, whatever the channels. So a plane undistorted alone
# and the same plane undistorted with its partner lie up to 1/64 px apart.
#
# Met with: an edge from 0 to 60000, sampled 0.015 px beside every pixel; the sample left of it, which
# is 900 by linear interpolation.
# Output seen:
#   linear: 1 channel 900, 2 channels 0, 3 channels 900, 4 channels 900, 5 channels 0
#   linear, float32: 1 channel 900, 2 channels 0, 3 channels 900, 4 channels 900, 5 channels 0
#   linear, float64: 1 channel 0, 2 channels 0, 3 channels 0, 4 channels 0, 5 channels 0
#   cubic: 1 channel 685, 2 channels 685, 3 channels 685, 4 channels 685
#   lanczos: 1 channel 0, 2 channels 0, 3 channels 0, 4 channels 0
# What the product does: it rounds places to 1/32 px itself and samples every plane alone, so that
# either version takes the same ones (runtime/geometry/warp.py; tests/runtime/geometry/test_warp.py).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --no-compile opencv-python-headless==5.0.0.93 numpy==2.4.6
cat > seen.py <<'PY'
import cv2
import numpy as np

EDGE = np.zeros((64, 64))
EDGE[:, 32:] = 60000
ROWS, COLUMNS = np.mgrid[:64, :64].astype(np.float32)
AT = 30, 31
KINDS = {
    "linear": (cv2.INTER_LINEAR, np.uint16, 5),
    "linear, float32": (cv2.INTER_LINEAR, np.float32, 5),
    "linear, float64": (cv2.INTER_LINEAR, np.float64, 5),
    "cubic": (cv2.INTER_CUBIC, np.float32, 4),
    "lanczos": (cv2.INTER_LANCZOS4, np.float32, 4),
}

for name, (flag, dtype, most) in KINDS.items():
    told = []
    for channels in range(1, most + 1):
        picture = np.repeat(EDGE[..., None], channels, axis=2).astype(dtype)
        found = cv2.remap(picture, COLUMNS + np.float32(0.015), ROWS, flag).reshape(64, 64, -1)
        told.append(f"{channels} channel{'s' * (channels > 1)} {found[AT][0]:.0f}")
    print(f"{name}: {', '.join(told)}")
PY
venv/bin/python seen.py 2>&1 | tee seen.txt
diff seen.txt - <<'SEEN'
linear: 1 channel 900, 2 channels 0, 3 channels 900, 4 channels 900, 5 channels 0
linear, float32: 1 channel 900, 2 channels 0, 3 channels 900, 4 channels 900, 5 channels 0
linear, float64: 1 channel 0, 2 channels 0, 3 channels 0, 4 channels 0, 5 channels 0
cubic: 1 channel 685, 2 channels 685, 3 channels 685, 4 channels 685
lanczos: 1 channel 0, 2 channels 0, 3 channels 0, 4 channels 0
SEEN

#!/usr/bin/env bash
# opencv-python-headless 5.0.0.93, numpy 2.4.6: a picture whose darkest pixel is grey comes out of
# tone mapping nearly black, and that pixel as NaN.
#
# createTonemapDrago takes the least sample of the picture off first. Of a pixel that holds it in
# all channels nothing is left, and it is divided by its own luminance, 0 / 0. The last step scales
# the result by its least and largest value; with a NaN among them the scale is left out, and the
# map is hundreds of times too dark. Black borders and monochrome pictures have such pixels; a
# picture in colour mostly has none, since its least sample is of one channel alone.
#
# A ramp over 20 stops, grey and with its red halved. Seen, largest value of the result (it should
# be 1 both times):
#     grey: 0.0058 (NaN: 24)   red halved: 1.0000 (NaN: 0)
# Nothing raises or warns of it.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/python -m pip install -q --disable-pip-version-check opencv-python-headless==5.0.0.93 numpy==2.4.6
venv/bin/python - <<'PROGRAM'
import cv2
import numpy as np

ramp = 2.0 ** np.linspace(-14, 6, 96, dtype=np.float32)
told, largest, missing = [], [], []
for name, red in (("grey", 1.0), ("red halved", 0.5)):
    light = np.stack([ramp, ramp, red * ramp], axis=-1)[None].repeat(8, axis=0)
    shown = cv2.createTonemapDrago(gamma=1.0, saturation=1.0, bias=0.85).process(light)
    largest.append(float(np.nanmax(shown)))
    missing.append(int(np.isnan(shown).sum()))
    told.append(f"{name}: {largest[-1]:.4f} (NaN: {missing[-1]})")
print("   ".join(told))
assert largest[0] < 0.01 and missing[0] > 0, "a grey picture is mapped rightly now"
assert largest[1] > 0.99 and missing[1] == 0
PROGRAM

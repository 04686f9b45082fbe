#!/usr/bin/env bash
# ptufile 2026.2.6: a histogram of a PTU ends at the last bin that a photon reached, and the bins of
# the laser's period, where they are asked for (dtime=0), are the period over the bin rounded down,
# so that a period of exactly 51 bins counts 50.
#
# Met with: periods of 25 ns in 16 to 399 bins, photons in bin 7 alone.
# Seen: "bins of the image: 8", and "one bin too few for 25 of 384 periods" (26, 51, 52, 53, 97, ...).
# What the product does: the period over the bin width, rounded (tests/runtime/kinds/spad/files/test_axes.py).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "ptufile==2026.2.6" "numpy>=2,<3"
cd "$folder"
"$folder/venv/bin/python" - <<'PYTHON'
import numpy as np
import ptufile

fewer = []
for bins in range(16, 400):
    cube = np.zeros((4, 5, bins), np.uint16)
    cube[..., 7] = 3
    ptufile.imwrite("a.ptu", cube, 25e-9, 25e-9 / bins)
    with ptufile.PtuFile("a.ptu") as file:
        assert file.number_bins_max >= bins
        if bins == 49:
            print("bins of the image:", file.shape[-1])
            assert file.shape[-1] == 8
        if file.number_bins_in_period == bins - 1:
            fewer.append(bins)
print("asked for all: one bin too few for", len(fewer), "of 384 periods, such as", fewer[:5])
assert fewer
PYTHON

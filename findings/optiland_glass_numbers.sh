#!/usr/bin/env bash
# A .zmx whose GLAS lines state n_d and V_d beside a glass name, as files made from patents do:
# optiland 0.6.3 goes by the name wherever a catalogue has it, however far the numbers are from it,
# and by the numbers where none has it. Nothing is said either way, so the focal length of a patent
# lens whose names are only near to its glasses is another than the patent's.
#
# Seen with optiland 0.6.3, n at 587.56 nm:
#     K5G20 with 1.5311 55.9: 1.5234
#     N-BK7 with 1.6000 40.0: 1.5168
#     UNHEARD with 1.6000 40.0: 1.6000
# Exits 1 if any of them changes.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet optiland==0.6.3
venv/bin/python -W ignore - <<'PYTHON'
import sys

import numpy as np
from optiland.fileio import load_zemax_file

SINGLET = """VERS 190513
MODE SEQ
UNIT MM X W X CM MR CPMM
ENPD 10
GCAT SCHOTT
WAVM 1 0.5875618 1
PWAV 1
FTYP 0 0 1 1 0 0 0
YFLN 0
SURF 0
  TYPE STANDARD
  CURV 0.0
  DISZ INFINITY
SURF 1
  STOP
  TYPE STANDARD
  CURV 0.02
  DISZ 5
  GLAS {name} 0 0 {index} {abbe} 0 0 0 0 0 0
  DIAM 6 1 0 0 1 ""
SURF 2
  TYPE STANDARD
  CURV 0
  DISZ 90
  DIAM 6 1 0 0 1 ""
SURF 3
  TYPE STANDARD
  CURV 0
  DISZ 0
  DIAM 6 0 0 0 1 ""
"""
SEEN = {("K5G20", 1.5311, 55.9): 1.5234, ("N-BK7", 1.6, 40.0): 1.5168, ("UNHEARD", 1.6, 40.0): 1.6}

changed = False
for (name, index, abbe), seen in SEEN.items():
    with open("singlet.zmx", "w", encoding="utf-8") as file:
        file.write(SINGLET.format(name=name, index=index, abbe=abbe))
    glass = load_zemax_file("singlet.zmx").surfaces[1].material_post
    found = float(np.ravel(glass.n(0.5875618))[0])
    print(f"{name} with {index:.4f} {abbe}: {found:.4f}")
    changed |= abs(found - seen) > 5e-5
sys.exit(changed)
PYTHON

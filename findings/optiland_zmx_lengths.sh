#!/usr/bin/env bash
# optiland 0.6.3 reads lengths of a valid .zmx that mean something else there; nothing is said.
#
# 1. UNIT is not looked at: a lens in inches or metres is read as one in millimetres. Its drawing
#    looks right, and all that has a scale of its own (Airy disc, waves of aberration) is wrong.
# 2. With FLOA (aperture by the stop's size) DIAM of the stop, a semi-diameter, is taken as diameter:
#    F/31.2 for a lens of F/15.6.
# 3. A toroid is written with the inverse of its radius of rotation as PARM 1 and read from PARM 2: a
#    file of optiland's own comes back as a cylinder.
#
# Seen, a planoconvex singlet of R = 50, stop of 3 behind it:
#     effective focal length in MM, IN, METER: 96.749 96.749 96.749 mm
#     f-number with ENPD 6.2116 and with FLOA: 15.576 31.151
#     radius of rotation 80 mm, PARM 1 of its file 0.0125, read again: inf
# What the product does: it reads UNIT and FLOA (tests/models_def/optics/lens_file/test_zmx_reader.py),
# refuses toroids by name, and writes optiland's JSON for optiland (docs/guides/lens-files.md).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --no-compile optiland==0.6.3
cat > seen.py <<'PY'
from pathlib import Path

import numpy as np
from optiland.fileio import load_zemax_file, save_zemax_file
from optiland.optic import Optic

SINGLET = """VERS 190513
MODE SEQ
UNIT {unit} X W X CM MR CPMM
{aperture}
GCAT SCHOTT
WAVM 1 0.5875618 1
PWAV 1
FTYP 0 0 1 1 0 0 0
XFLN 0
YFLN 0
SURF 0
  TYPE STANDARD
  CURV 0.0
  DISZ INFINITY
SURF 1
  TYPE STANDARD
  CURV 0.02
  DISZ 5
  GLAS N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0
  DIAM 6 1 0 0 1 ""
SURF 2
  STOP
  TYPE STANDARD
  CURV 0
  DISZ 90
  DIAM 3 1 0 0 1 ""
SURF 3
  TYPE STANDARD
  CURV 0
  DISZ 0
  DIAM 6 0 0 0 1 ""
"""


def axis_of(unit="MM", aperture="ENPD 6.2116"):
    Path("lens.zmx").write_text(SINGLET.format(unit=unit, aperture=aperture), "utf-8")
    return load_zemax_file("lens.zmx").paraxial


def number(value):
    return f"{float(np.ravel(value)[0]):.3f}"


print("effective focal length in MM, IN, METER:",
      *(number(axis_of(unit).f2()) for unit in ("MM", "IN", "METER")), "mm")
print("f-number with ENPD 6.2116 and with FLOA:",
      *(number(axis_of(aperture=a).FNO()) for a in ("ENPD 6.2116", "FLOA")))

lens = Optic()
lens.surfaces.add(index=0, thickness=np.inf)
lens.surfaces.add(index=1, surface_type="toroidal", radius_x=80.0, radius_y=50.0, thickness=5,
                  material=("N-BK7", "schott"), is_stop=True, toroidal_coeffs_poly_y=[])
lens.surfaces.add(index=2, thickness=90)
lens.surfaces.add(index=3)
lens.set_aperture(aperture_type="EPD", value=6.0)
lens.fields.set_type("angle")
lens.fields.add(y=0)
lens.wavelengths.add(value=0.5875618, is_primary=True)
save_zemax_file(lens, "toroid.zmx")
lines = Path("toroid.zmx").read_text("utf-8").splitlines()
stated = float(next(line for line in lines if "PARM 1 " in line).split()[-1])
again = load_zemax_file("toroid.zmx").surfaces[1].geometry
print(f"radius of rotation {float(lens.surfaces[1].geometry.R_rot):.0f} mm, "
      f"PARM 1 of its file {stated:g}, read again: {float(again.R_rot)}")
PY
venv/bin/python -W ignore seen.py | tee seen.txt
diff seen.txt - <<'SEEN'
effective focal length in MM, IN, METER: 96.749 96.749 96.749 mm
f-number with ENPD 6.2116 and with FLOA: 15.576 31.151
radius of rotation 80 mm, PARM 1 of its file 0.0125, read again: inf
SEEN

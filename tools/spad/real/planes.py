"""TMF8820, 9 zones of 128 bins before a wall at known distances.

Slope and offset of every zone are fitted on half of the entries and judged on the other half, and
the other way round: bins are not of the width that the maker states. Beyond 0.1 m alone: nearer,
the pulse runs into what the sensor's own cover reflects.
"""

import json
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tools.spad.real.claim import Claim
from tools.spad.real.face import Product, product
from tools.spad.real.panels import Panel, write_panels

FILE: Final = "tmf8820_plane_even.json"
BEYOND_M: Final = 0.1
MOST_MM: Final = 1.2
TIMING: Final = """
[timing]
orientation = "histogram"
time_bin_ps = 91
"""


def measure(folder: Path, out: Path) -> list[Claim]:
    """Measure the errors of every zone."""
    entries = json.loads((folder / FILE).read_text(encoding="utf-8"))
    true_m = np.array([entry["dist_to_plane"] for entry in entries])
    hists = np.array([entry["hists"] for entry in entries])
    with tempfile.TemporaryDirectory() as scratch:
        capture = Path(scratch) / "zones.npz"
        np.savez(capture, histogram=hists.transpose(2, 0, 1))
        found = product(capture, TIMING, pool="1")
    rms, residual = zone_errors_mm(found.arrays["time_of_flight_ps"], true_m)
    onboard = np.array([entry["distances"][0]["depths_1"] for entry in entries], dtype=float)
    theirs, _ = zone_errors_mm(onboard, true_m)

    far = true_m > BEYOND_M
    write_panels(out / "tmf8820.png", _panels(found, residual, hists), columns=4)
    valid = found.arrays["valid"][far].mean()

    return [
        Claim(capture=FILE, what="rms of the worst zone", value=rms.max(), unit="mm", most=MOST_MM),
        Claim(capture=FILE, what="rms of the best zone", value=rms.min(), unit="mm"),
        Claim(capture=FILE, what="the sensor's own, worst zone", value=theirs.max(), unit="mm"),
        Claim(capture=FILE, what="the sensor's own, best zone", value=theirs.min(), unit="mm"),
        Claim(capture=FILE, what="valid beyond 0.1 m", value=valid),
    ]


def zone_errors_mm(
    times_ps: NDArray[np.float64], true_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rms (zones,) and residuals (entries, zones) in mm, NaN where nearer than is judged.

    Args:
        times_ps: (entries, zones).
        true_m: (entries,).
    """
    far = true_m > BEYOND_M
    residual = np.full(times_ps.shape, np.nan)
    every = np.arange(len(true_m))
    for zone in range(times_ps.shape[1]):
        for half in (0, 1):
            fitted, judged = far & (every % 2 != half), far & (every % 2 == half)
            line = np.polyfit(times_ps[fitted, zone], true_m[fitted], 1)
            own = np.polyval(line, times_ps[judged, zone]) - true_m[judged]
            residual[judged, zone] = own * 1000
    return np.sqrt(np.nanmean(residual**2, axis=0)), residual


def _panels(
    found: Product, residual: NDArray[np.float64], hists: NDArray[np.float64]
) -> list[Panel]:
    return [
        Panel(title="zone 4: log counts, entry down, bin right", values=np.log1p(hists[:, 4])),
        Panel(title="depth, m", values=found.arrays["depth_m"]),
        Panel(title="residual, mm", values=residual, span=(-2, 2), colors="RdBu"),
        Panel(title="sigma, ps", values=found.arrays["sigma_ps"]),
    ]

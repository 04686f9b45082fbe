"""First order and spots of lens files by optiland; it imports nothing of camkit.

    PYTHON_OF_OPTILAND tools/comparison/optiland_worker.py FILE [FILE ...]

Prints a line of JSON for each file (.json by its own reader, .zmx by its reader of those): the
focal length, the way from the last surface to the paraxial focus and the RMS spot about the
centroid on the axis at the primary wavelength, hexapolar in RINGS rings, and where the chief ray of
the last field lands by robust ray aiming, or the error.
"""

import json
import sys
import warnings
from typing import Any

import numpy as np
from optiland.distribution import create_distribution
from optiland.fileio import load_optiland_file, load_zemax_file

RINGS = 6


def facts(path: str) -> dict[str, Any]:
    """Return the numbers of one file."""
    optic = load_optiland_file(path) if path.endswith(".json") else load_zemax_file(path)
    points = create_distribution("hexapolar")
    points.generate_points(num_rings=RINGS)
    wave = optic.primary_wavelength
    rays = optic.trace(Hx=0, Hy=0, wavelength=wave, num_rays=None, distribution=points)
    place = np.stack([np.asarray(rays.x), np.asarray(rays.y)])
    alive = np.isfinite(place).all(0) & (np.asarray(rays.i) > 0)
    middle = place[:, alive].mean(1, keepdims=True)
    spot_mm = float(np.sqrt(((place[:, alive] - middle) ** 2).sum(0).mean()))
    efl_mm = float(np.ravel(optic.paraxial.f2())[0])
    return {
        "efl_mm": efl_mm,
        "spot_um": 1000 * spot_mm,
        "rays": int(alive.sum()),
        "chief_mm": chief_mm(optic),
    }


def chief_mm(optic: Any) -> float | None:
    """Return how far from the axis the chief ray of the last field lands; None if it is lost."""
    try:
        optic.set_ray_aiming("robust")
        chief = optic.trace_generic(0, 1, 0, 0, optic.primary_wavelength)
        height_mm = abs(float(np.ravel(chief.y)[-1]))
    except Exception:  # noqa: BLE001 -- another program's errors are its own
        return None
    return height_mm if np.isfinite(height_mm) else None


def main() -> None:
    """Print the numbers of every file."""
    warnings.filterwarnings("ignore")
    for path in sys.argv[1:]:
        try:
            result = facts(path)
        except Exception as error:  # noqa: BLE001 -- another program's errors are its own
            result = {"error": f"{type(error).__name__}: {error}"[:200]}
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()

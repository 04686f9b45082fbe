"""Few photons, much background."""

from typing import Any, Final

import numpy as np

from camkit.report.kinds.spad.synthetic import AXIS, PULSE, Light, bound_ps, draw
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from tools.spad.limit.judged import Sweep, judged, swept

PHOTONS: Final = (10_000, 3000, 1000, 300, 100, 50, 30, 20, 15, 10, 7, 5, 3, 2, 1)
SBRS: Final = (10, 3, 1, 0.5, 0.3, 0.2, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01)
SPAN_PS: Final = (400.0, 2100.0)
SHAPE: Final = (64, 128)


def sweeps() -> list[Sweep]:
    """Measure photons at SBR 3, SBR at 100 and 1000 photons; single pixels."""
    return [
        swept("photons, SBR 3", "photons", PHOTONS, lambda n: _point(n, n, 3.0)),
        swept("SBR, 100 photons", "", SBRS, lambda sbr: _point(sbr, 100, sbr)),
        swept("SBR, 1000 photons", "", SBRS, lambda sbr: _point(sbr, 1000, sbr)),
    ]


def _point(value: float, photons: float, sbr: float) -> dict[str, Any]:
    rng = np.random.default_rng(int(1000 * value))
    light = Light(photons=photons, sbr=sbr)
    times = rng.uniform(*SPAN_PS, SHAPE[0] * SHAPE[1])
    cube = draw(times, light, rng).reshape(*SHAPE, AXIS.bins)
    found = Sharpener(AXIS, PULSE, Way(pool="1")).strip(cube)
    errors = found.time_of_flight_ps.ravel() - times
    return judged(value, errors, bound_ps(times, light), found.valid.ravel())

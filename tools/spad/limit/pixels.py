"""Dark counts that differ from pixel to pixel, and hot pixels."""

from typing import Any, Final

import numpy as np

from camkit.report.kinds.spad.synthetic import AXIS, PULSE, Light, bound_ps, draw
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from tools.spad.limit.judged import Sweep, judged, swept

DARK: Final = (0.001, 0.01, 0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 100.0)
HOT: Final = (0.001, 0.01, 0.03, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
SPREAD: Final = 1.0
"""Of the logarithm of dark counts, from pixel to pixel."""
HOT_COUNTS: Final = 5.0
LEAST_FOUND: Final = 0.5
"""Of the hot pixels."""
PHOTONS: Final = 100.0
SHAPE: Final = (64, 64)


def sweeps() -> list[Sweep]:
    """Measure a map of dark counts, and ever more hot pixels; 100 photons a pixel."""
    return [
        swept("dark counts of a bin, log-normal map", "counts", DARK, _dark),
        swept("hot pixels", "share", HOT, _hot),
    ]


def _dark(mean: float) -> dict[str, Any]:
    rng = np.random.default_rng(int(1000 * mean))
    times = _slope()
    dark = mean * rng.lognormal(-(SPREAD**2) / 2, SPREAD, len(times))
    counts = draw(times, Light(photons=PHOTONS, sbr=np.inf), rng)
    counts += rng.poisson(dark[:, None], counts.shape).astype(np.float32)
    found = Sharpener(AXIS, PULSE, Way(pool="1")).strip(counts.reshape(*SHAPE, AXIS.bins))
    bounds = np.empty(len(times))
    for level in np.unique(np.round(np.log(dark), 1)):
        own = np.round(np.log(dark), 1) == level
        sbr = PHOTONS / np.exp(level) / AXIS.bins
        bounds[own] = bound_ps(times[own], Light(photons=PHOTONS, sbr=sbr))
    errors = found.time_of_flight_ps.ravel() - times
    taken = float(found.hot.mean())
    return judged(mean, errors, bounds, found.valid.ravel(), taken_for_hot=taken)


def _hot(share: float) -> dict[str, Any]:
    rng = np.random.default_rng(int(1000 * share))
    times, light = _slope(), Light(photons=PHOTONS, sbr=10.0)
    counts = draw(times, light, rng)
    hot = rng.random(len(times)) < share
    counts[hot] += rng.poisson(HOT_COUNTS, (int(hot.sum()), AXIS.bins)).astype(np.float32)
    found = Sharpener(AXIS, PULSE, Way()).strip(counts.reshape(*SHAPE, AXIS.bins))
    told = found.hot.ravel()
    errors = found.time_of_flight_ps.ravel() - times
    sound = ~hot
    point = judged(
        share,
        errors[sound],
        bound_ps(times[sound], light),
        found.valid.ravel()[sound],
        found=float(told[hot].mean()) if hot.any() else 1.0,
        falsely=float(told[sound].mean()),
    )
    point["broken"] |= point["found"] < LEAST_FOUND
    return point


def _slope() -> np.ndarray[Any, np.dtype[np.float64]]:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray(600.0 + 10 * y.ravel() + 8 * x.ravel())

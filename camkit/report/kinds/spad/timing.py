"""Rows of times of flight: errors against the Cramer-Rao bound, and CPU seconds.

Every row is a method at one level of light: RMSE over the bound of each pixel, the share of
|error| / sigma below 1, false alarms of pixels that hold background alone, and CPU seconds for
256 x 128 pixels of 125 bins, the set-up of the bank included. scipy's curve_fit and the brightest
bin stand beside the two methods of `camkit process`; curve_fit runs on few pixels, its seconds are
scaled up. Seconds of methods are taken in turns, and the median is told. RMSE leaves out pixels
that are not believed, and errors beyond a gate's width, whose share is `lost`.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit

from camkit.arrays import FloatArray
from camkit.report.kinds.spad.synthetic import AXIS, PULSE, Light, bound_ps, draw
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way

SHAPE: Final = (128, 256)
PHOTONS: Final = (10.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1000.0, 10_000.0)
SBRS: Final = (np.inf, 3.0, 1.0, 0.3, 0.1)
QUICK: Final = ((30.0, np.inf), (30.0, 1.0), (1000.0, np.inf), (1000.0, 1.0))
"""Photons and SBR where a rough picture will do."""
FITTED: Final = 300
SPAN_PS: Final = (400.0, 2100.0)
METHODS: Final = ("log", "lsq", "argmax", "curve_fit")

Estimates = tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.bool_]]
"""Times, their sigmas, and whether they are believed."""


def timing_rows(
    repeat: int, tell: Callable[[str], None], *, quick: bool = False
) -> Iterator[dict[str, Any]]:
    """Judge all methods at all levels of light.

    Args:
        repeat: How often seconds are taken.
        tell: Called with what begins.
        quick: Whether few levels will do.
    """
    levels = QUICK if quick else [(photons, sbr) for sbr in SBRS for photons in PHOTONS]
    for photons, sbr in levels:
        tell(f"times of flight, {photons:g} photons, SBR {sbr:g}")
        yield from measure(Light(photons=photons, sbr=sbr), SHAPE[0] * SHAPE[1], repeat)


def measure(light: Light, pixels: int, turns: int) -> list[dict[str, Any]]:
    """Return the rows of all methods at one level of light."""
    rng = np.random.default_rng([int(light.photons), int(1000 / light.sbr)])
    times = rng.uniform(*SPAN_PS, pixels)
    counts, empty = draw(times, light, rng), draw(times, light, rng, empty=True)
    bounds = bound_ps(times, light)
    methods: dict[str, Callable[[FloatArray], Estimates]] = {
        "log": _by_camkit("log"),
        "lsq": _by_camkit("lsq"),
        "argmax": _by_argmax,
    }
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    estimates: dict[str, Estimates] = {}
    for _ in range(turns):
        for name, fit in methods.items():
            began = time.process_time()
            estimates[name] = fit(counts)
            seconds[name].append(time.process_time() - began)
    some = slice(0, min(FITTED, pixels))
    began = time.process_time()
    estimates["curve_fit"] = _by_curve_fit(counts[some])
    seconds["curve_fit"].append((time.process_time() - began) * pixels / (some.stop))
    rows = []
    for name in METHODS:
        part = some if name == "curve_fit" else slice(None)
        row = _judged(estimates[name], times[part], bounds[part])
        is_judged = name in {"log", "lsq"} and light.background > 0
        alarms = float(methods[name](empty)[2].mean()) if is_judged else None
        rows.append(
            {
                "sort": "timing",
                "method": name,
                "photons": light.photons,
                "sbr": None if np.isinf(light.sbr) else light.sbr,
                **row,
                "false_alarms": alarms,
                "cpu_seconds": round(float(np.median(seconds[name])), 4),
            }
        )
    return rows


def _by_camkit(method: str) -> Callable[[FloatArray], Estimates]:
    def fit(counts: FloatArray) -> Estimates:
        sharpener = Sharpener(AXIS, PULSE, Way(method=method, pool="1"))  # type: ignore[arg-type]
        depth = sharpener.strip(counts.reshape(-1, min(SHAPE[1], len(counts)), AXIS.bins))
        return depth.time_of_flight_ps.ravel(), depth.sigma_ps.ravel(), depth.valid.ravel()

    return fit


def _by_argmax(counts: FloatArray) -> Estimates:
    brightest = AXIS.centres_ps[counts.argmax(axis=1)]
    # where the pulse is brightest, relative to its time of flight
    u = np.arange(PULSE.start_ps, PULSE.end_ps)
    times = brightest + u[PULSE.density(u).argmax()]
    return times, None, np.ones(len(counts), bool)


def _by_curve_fit(counts: FloatArray) -> Estimates:
    start = _by_argmax(counts)[0]
    times, good = start.copy(), np.zeros(len(counts), bool)
    every = np.arange(AXIS.bins)[None]

    def model(_: Any, mu: float, a: float, b: float) -> NDArray[np.float64]:
        return np.asarray(a * AXIS.shares(PULSE, np.array([mu]), every)[0] + b)

    for i, n in enumerate(counts):
        first = (start[i], max(float(n.sum()) * 0.7, 1.0), 0.3 * float(n.mean()))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                times[i] = curve_fit(model, AXIS.centres_ps, n, first, maxfev=400)[0][0]
                good[i] = True
            except RuntimeError:
                continue
    return times, None, good


def _judged(
    estimates: Estimates, times: NDArray[np.float64], bounds: NDArray[np.float64]
) -> dict[str, Any]:
    fitted, sigmas, valid = estimates
    errors = fitted - times
    accepted = valid & (np.abs(errors) < PULSE.width_ps)
    if not accepted.any():
        return {"rmse_over_crb": None, "sigma_68": None, "accepted": 0.0, "lost": None}
    ratio = np.sqrt(np.mean((errors[accepted] / bounds[accepted]) ** 2))
    share = None if sigmas is None else np.quantile(np.abs(errors / sigmas)[accepted], 0.6827)
    return {
        "rmse_over_crb": round(float(ratio), 4),
        "sigma_68": None if share is None else round(float(share), 4),
        "accepted": round(float(valid.mean()), 4),
        "lost": round(float((valid & ~accepted).sum() / max(valid.sum(), 1)), 5),
    }

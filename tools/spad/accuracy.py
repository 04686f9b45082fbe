"""Errors of depth against the Cramer-Rao bound, over photons and background, and CPU seconds.

    python -m tools.spad.accuracy --out-dir out/spad

Every row is a method at one level of light: RMSE over the bound of each pixel, the share of
|error| / sigma below 1, false alarms of pixels that hold background alone, and CPU seconds for
256 x 128 pixels of 125 bins, the set-up of the bank included. scipy's curve_fit and the brightest
bin stand beside the two methods of `camkit process`; curve_fit runs on few pixels, its seconds are
scaled up. Seconds of methods are taken in turns, and the median is told. RMSE leaves out pixels
that are not believed, and errors beyond a gate's width, whose share is `lost`.

False alarms are counted again on many more pixels of background alone, from one count in 200 bins
to ten a bin, single pixels and `--pool auto`. What was aimed at is printed with what was reached.
"""

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import curve_fit

from camkit.contracts import FloatArray
from camkit.report.bench.machine import describe_machine
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from tools.spad.synthetic import AXIS, PULSE, Light, bound_ps, draw

SHAPE: Final = (128, 256)
PHOTONS: Final = (10.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1000.0, 10_000.0)
SBRS: Final = (np.inf, 3.0, 1.0, 0.3, 0.1)
FITTED: Final = 300
SPAN_PS: Final = (400.0, 2100.0)
TURNS: Final = 5
METHODS: Final = ("log", "lsq", "argmax", "curve_fit")
BACKGROUNDS: Final = (0.005, 0.02, 0.05, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Counts of a bin."""
ALARM_PIXELS: Final = 262_144


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and write JSON and a chart."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    parser.add_argument("--photons", type=float, nargs="+", default=PHOTONS)
    parser.add_argument("--sbr", type=float, nargs="+", default=SBRS)
    parser.add_argument("--pixels", type=int, default=SHAPE[0] * SHAPE[1])
    parser.add_argument("--turns", type=int, default=TURNS)
    parser.add_argument("--alarm-pixels", type=int, default=ALARM_PIXELS)
    options = parser.parse_args(arguments)
    rows = []
    for sbr in options.sbr:
        for photons in options.photons:
            rows += measure(Light(photons=photons, sbr=sbr), options.pixels, options.turns)
            print(f"{photons:g} photons, SBR {sbr:g}", file=sys.stderr)
    options.out_dir.mkdir(parents=True, exist_ok=True)
    alarms = [false_alarms(b, options.alarm_pixels) for b in BACKGROUNDS]
    aims = verdicts(rows, alarms)
    for aim in aims:
        print(json.dumps(aim))
    record = {"machine": describe_machine(), "aims": aims, "false_alarms": alarms, "rows": rows}
    path = options.out_dir / "depth-accuracy.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    chart(rows, options.out_dir / "depth-accuracy.png")
    return 0


def measure(light: Light, pixels: int, turns: int) -> list[dict[str, Any]]:
    """Give the rows of all methods at one level of light."""
    rng = np.random.default_rng([int(light.photons), int(1000 / light.sbr)])
    times = rng.uniform(*SPAN_PS, pixels)
    counts, empty = draw(times, light, rng), draw(times, light, rng, empty=True)
    bounds = bound_ps(times, light)
    methods: dict[str, Callable[[FloatArray], Found]] = {
        "log": _by_camkit("log"),
        "lsq": _by_camkit("lsq"),
        "argmax": _by_argmax,
    }
    seconds: dict[str, list[float]] = {name: [] for name in METHODS}
    found: dict[str, Found] = {}
    for _ in range(turns):
        for name, fit in methods.items():
            began = time.process_time()
            found[name] = fit(counts)
            seconds[name].append(time.process_time() - began)
    some = slice(0, min(FITTED, pixels))
    began = time.process_time()
    found["curve_fit"] = _by_curve_fit(counts[some])
    seconds["curve_fit"].append((time.process_time() - began) * pixels / (some.stop))
    rows = []
    for name in METHODS:
        part = some if name == "curve_fit" else slice(None)
        row = _judged(found[name], times[part], bounds[part])
        is_judged = name in {"log", "lsq"} and light.background > 0
        alarms = float(methods[name](empty)[2].mean()) if is_judged else None
        rows.append(
            {
                "method": name,
                "photons": light.photons,
                "sbr": None if np.isinf(light.sbr) else light.sbr,
                **row,
                "false_alarms": alarms,
                "cpu_seconds": round(float(np.median(seconds[name])), 4),
            }
        )
    return rows


def false_alarms(background: float, pixels: int) -> dict[str, Any]:
    """Give the share of pixels of background alone that are believed, alone and pooled."""
    rng = np.random.default_rng(int(1000 * background))
    rates: dict[str, list[float]] = {"1": [], "auto": []}
    ways = {pool: Sharpener(AXIS, PULSE, Way(pool=pool)) for pool in ("1", "auto")}
    size = SHAPE[0] * SHAPE[1]
    for _ in range(max(1, pixels // size)):
        cube = rng.poisson(background, (*SHAPE, AXIS.bins)).astype(np.float32)
        for pool, sharpener in ways.items():
            rates[pool].append(float(sharpener.strip(cube).valid.mean()))
    told = {f"pool_{pool}": round(float(np.mean(found)), 6) for pool, found in rates.items()}
    return {"background": background, **told}


def verdicts(
    rows: Sequence[dict[str, Any]], alarms: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Give what was aimed at, with the worst that was reached."""
    log = {(row["photons"], row["sbr"]): row for row in rows if row["method"] == "log"}
    lsq = {(row["photons"], row["sbr"]): row for row in rows if row["method"] == "lsq"}
    slow = {(r["photons"], r["sbr"]): r for r in rows if r["method"] == "curve_fit"}
    bright = {key: row for key, row in log.items() if key[1] is None or key[1] >= 1}
    seconds = np.median([row["cpu_seconds"] for row in log.values()])
    ratios = [slow[key]["cpu_seconds"] / row["cpu_seconds"] for key, row in log.items()]
    shares = [r["sigma_68"] for key, r in log.items() if key[0] >= 30 and r["sigma_68"]]
    gain = [
        1 - row["rmse_over_crb"] / lsq[key]["rmse_over_crb"]
        for key, row in log.items()
        if key[1] is None and key[0] >= 30 and row["rmse_over_crb"]
    ]

    def worst(least: float) -> float:
        found = [r["rmse_over_crb"] for key, r in bright.items() if key[0] >= least]
        return float(max([ratio for ratio in found if ratio], default=np.nan))

    noisiest = max(max(row["pool_1"], row["pool_auto"]) for row in alarms)
    judged: list[tuple[str, float, float | None, float | None]] = [
        ("CPU seconds of 256x128x125, median", float(seconds), None, 0.1),
        ("times faster than curve_fit, median", float(np.median(ratios)), 300, None),
        ("RMSE / bound from 50 photons, SBR >= 1", worst(50), None, 1.03),
        ("RMSE / bound from 30 photons, SBR >= 1", worst(30), None, 1.06),
        ("below least squares without background, least", min(gain, default=np.nan), 0.15, None),
        ("68 % of |error| / sigma from 30 photons, least", min(shares), 0.93, None),
        ("68 % of |error| / sigma from 30 photons, most", max(shares), None, 1.07),
        ("false alarms, most", noisiest, None, 1e-3),
    ]
    return [
        {
            "what": what,
            "value": round(value, 5),
            "least": least,
            "most": most,
            "met": bool((least is None or value >= least) and (most is None or value <= most)),
        }
        for what, value, least, most in judged
    ]


Found = tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.bool_]]
"""Times, their sigmas, and whether they are believed."""


def _by_camkit(method: str) -> Callable[[FloatArray], Found]:
    def fit(counts: FloatArray) -> Found:
        sharpener = Sharpener(AXIS, PULSE, Way(method=method, pool="1"))  # type: ignore[arg-type]
        found = sharpener.strip(counts.reshape(-1, min(SHAPE[1], len(counts)), AXIS.bins))
        return found.time_of_flight_ps.ravel(), found.sigma_ps.ravel(), found.valid.ravel()

    return fit


def _by_argmax(counts: FloatArray) -> Found:
    brightest = AXIS.centres_ps[counts.argmax(axis=1)]
    # where the pulse is brightest, relative to its time of flight
    u = np.arange(PULSE.start_ps, PULSE.end_ps)
    times = brightest + u[PULSE.density(u).argmax()]
    return times, None, np.ones(len(counts), bool)


def _by_curve_fit(counts: FloatArray) -> Found:
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
    found: Found, times: NDArray[np.float64], bounds: NDArray[np.float64]
) -> dict[str, Any]:
    fitted, sigmas, valid = found
    errors = fitted - times
    kept = valid & (np.abs(errors) < PULSE.width_ps)
    if not kept.any():
        return {"rmse_over_crb": None, "sigma_68": None, "accepted": 0.0, "lost": None}
    ratio = np.sqrt(np.mean((errors[kept] / bounds[kept]) ** 2))
    share = None if sigmas is None else np.quantile(np.abs(errors / sigmas)[kept], 0.6827)
    return {
        "rmse_over_crb": round(float(ratio), 4),
        "sigma_68": None if share is None else round(float(share), 4),
        "accepted": round(float(valid.mean()), 4),
        "lost": round(float((valid & ~kept).sum() / max(valid.sum(), 1)), 5),
    }


def chart(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw RMSE over the bound, and error over sigma, a column for every background."""
    from matplotlib.figure import Figure

    sbrs = list(dict.fromkeys(row["sbr"] for row in rows))
    figure = Figure(figsize=(3.1 * len(sbrs), 5.6), layout="constrained")
    axes, below = figure.subplots(2, len(sbrs), sharey="row", squeeze=False)
    for axis, lower, sbr in zip(axes, below, sbrs, strict=True):
        for name in METHODS:
            own = [r for r in rows if r["sbr"] == sbr and r["method"] == name]
            own = [r for r in own if r["rmse_over_crb"] is not None]
            axis.plot(
                [r["photons"] for r in own], [r["rmse_over_crb"] for r in own], "o-", label=name
            )
            told = [r for r in own if r["sigma_68"] is not None]
            if told:
                lower.plot([r["photons"] for r in told], [r["sigma_68"] for r in told], "o-")
        lower.axhspan(0.93, 1.07, color="0.9")
        lower.set(xscale="log", ylim=(0.8, 1.3), xlabel="signal photons")
        axis.set(xscale="log", ylim=(0.95, 2.0))
        axis.set_title("no background" if sbr is None else f"SBR {sbr:g}")
        axis.axhline(1.0, color="0.6", lw=0.8)
    axes[0].set_ylabel("RMSE / Cramer-Rao bound")
    below[0].set_ylabel("68 % of |error| / sigma")
    axes[-1].legend(fontsize=8)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())

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
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.report.bench.machine import describe_machine
from camkit.report.kinds.spad.synthetic import Light
from camkit.report.kinds.spad.timing import METHODS, PHOTONS, SBRS, SHAPE, false_alarms, measure

TURNS: Final = 5
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


def verdicts(
    rows: Sequence[dict[str, Any]], alarms: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return what was aimed at, with the worst that was reached."""
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

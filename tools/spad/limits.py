"""Where sharpening of histograms breaks: photons, background, pile-up, pixels, wrong statements.

    python -m tools.spad.limits --out-dir out/spad

Pixels are drawn behind the prototype's gate. A point is broken where RMSE exceeds 1.5 times the
Cramer-Rao bound, less than half of the pixels are valid, or more than 1 % of the valid ones are
further off than the gate is wide; of two returns, where less than half of the pixels show both
within 100 ps. Writes spad-limits.json and one picture.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from camkit.report.bench.machine import describe_machine
from tools.spad.limit import light, pile_up, pixels, stated
from tools.spad.limit.judged import Sweep


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all conditions; write JSON and a picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out-dir", type=Path, default=Path("out/spad"))
    options = parser.parse_args(arguments)
    sweeps = [sweep for part in (light, pile_up, pixels, stated) for sweep in part.sweeps()]
    for sweep in sweeps:
        print(f"{sweep.name:45} breaks at {sweep.breaks_at} {sweep.unit}")
    options.out_dir.mkdir(parents=True, exist_ok=True)
    record = {"machine": describe_machine(), "sweeps": [sweep.row() for sweep in sweeps]}
    path = options.out_dir / "spad-limits.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    chart(sweeps, options.out_dir / "spad-limits.png")
    return 0


def chart(sweeps: Sequence[Sweep], path: Path) -> None:
    """Draw the valid and the wrong share, and RMSE over the bound, of every condition."""
    from matplotlib.figure import Figure

    columns = 5
    rows = -(-len(sweeps) // columns)
    figure = Figure(figsize=(3.2 * columns, 2.6 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, sweep in zip(axes, sweeps, strict=False):
        points = sorted(sweep.points, key=lambda point: point["value"])
        values = [point["value"] for point in points]
        axis.plot(values, [point["valid"] for point in points], "o-", ms=3, label="valid")
        axis.plot(values, [point["wrong"] for point in points], "s-", ms=3, label="wrong")
        ratios = [(p["value"], p.get("rmse_over_crb")) for p in points]
        shown = [(value, min(ratio, 4) / 4) for value, ratio in ratios if ratio is not None]
        if shown:
            axis.plot(*zip(*shown, strict=True), "^--", ms=3, label="RMSE / bound / 4")
        if not isinstance(values[0], str) and values[-1] > 5 * values[0]:
            axis.set_xscale("log")
        for point in points:
            if point["broken"]:
                axis.axvline(point["value"], color="0.85", lw=4, zorder=0)
        axis.set(ylim=(-0.05, 1.05), xlabel=sweep.unit)
        axis.set_title(sweep.name, fontsize=8)
    for axis in axes[len(sweeps) :]:
        axis.set_axis_off()
    axes[0].legend(fontsize=7)
    figure.savefig(path, dpi=75)


if __name__ == "__main__":
    sys.exit(main())

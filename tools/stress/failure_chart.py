"""Where methods fail, drawn from what `camkit stress` wrote: some of its scenarios in one picture.

    python -m tools.stress.failure_chart stress.json -o failures.png --scenarios psf_scale haze

A panel for each: PSNR of every method over the knob, dotted lines where a network breaks.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from camkit.report.figure import GRID_COLOR, MARKS, field_color, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS: Final = 3
Scenario = dict[str, Any]


def main() -> int:
    """Read, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("report", type=Path, help="stress.json")
    parser.add_argument("--scenarios", nargs="+", required=True)
    parser.add_argument("-o", "--out", type=Path, required=True)
    chosen = parser.parse_args()
    try:
        read = json.loads(chosen.report.read_text(encoding="utf-8"))
        known = {one["scenario"]: one for one in read}
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise SystemExit(f"error: {chosen.report} is no report of camkit stress: {error}") from None
    missing = [name for name in chosen.scenarios if not known.get(name, {}).get("values")]
    if missing:
        raise SystemExit(f"error: {chosen.report} has no measured {', '.join(missing)}")
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.out.write_bytes(to_png(draw([known[name] for name in chosen.scenarios])))
    return 0


def draw(scenarios: Sequence[Scenario]) -> "Figure":
    """Draw scenarios, as `camkit stress` reports them, in rows of three."""
    rows = -(-len(scenarios) // COLUMNS)
    figure = new_figure(3.4 * COLUMNS, 2.6 * rows)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel in panels[len(scenarios) :]:
        panel.set_axis_off()
    # a method looks alike in every panel, whether the others have it or not
    methods = list(dict.fromkeys(name for one in scenarios for name in one["psnr_db"]))
    shown: dict[str, Artist] = {}
    for panel, scenario in zip(panels, scenarios, strict=False):
        _panel(panel, scenario, methods)
        lines, names = panel.get_legend_handles_labels()
        shown |= dict(zip(names, lines, strict=True))
    figure.legend(
        [shown[name] for name in methods],
        methods,
        loc="outside upper center",
        ncols=9,
        fontsize=8,
    )
    return figure


def _panel(panel: "Axes", scenario: Scenario, methods: Sequence[str]) -> None:
    values = np.array(scenario["values"], dtype=float)
    for method, decibels in scenario["psnr_db"].items():
        number = methods.index(method)
        color = field_color(number)
        mean = np.array(decibels, dtype=float)
        mark = MARKS[number % len(MARKS)]
        panel.plot(values, mean, color=color, marker=mark, markersize=3, linewidth=1, label=method)
        for found in scenario["breaks"]:
            if found["method"] == method and found["break_point"] is not None:
                panel.axvline(found["break_point"], color=color, linewidth=1, linestyle=":")
    panel.set_title(scenario["title"], fontsize=8)
    panel.set_xlabel(f"{scenario['knob']} ({scenario['unit']})".replace(" ()", ""), fontsize=8)
    panel.set_ylabel("PSNR, dB", fontsize=8)
    panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    panel.tick_params(labelsize=7)


if __name__ == "__main__":
    raise SystemExit(main())

"""Where methods fail, drawn from what `camkit stress` wrote: some of its scenarios in one picture.

    python -m tools.failure_chart stress.json -o failures.png --scenarios psf_scale black_level

A panel for each: PSNR of every method over the knob, dotted lines where a network breaks.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from camkit.report.figure import FIELD_COLORS, GRID_COLOR, MARKS, new_figure, to_png

if TYPE_CHECKING:
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
    known = {one["scenario"]: one for one in json.loads(chosen.report.read_text(encoding="utf-8"))}
    missing = [name for name in chosen.scenarios if not known.get(name, {}).get("values")]
    if missing:
        raise SystemExit(f"error: {chosen.report} has no measured {', '.join(missing)}")
    chosen.out.write_bytes(to_png(draw([known[name] for name in chosen.scenarios])))
    return 0


def draw(scenarios: Sequence[Scenario]) -> "Figure":
    """Draw scenarios, as `camkit stress` reports them, in rows of three."""
    rows = -(-len(scenarios) // COLUMNS)
    figure = new_figure(3.4 * COLUMNS, 2.6 * rows)
    panels = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for panel in panels[len(scenarios) :]:
        panel.set_axis_off()
    for panel, scenario in zip(panels, scenarios, strict=False):
        _panel(panel, scenario)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=9, fontsize=8
    )
    return figure


def _panel(panel: "Axes", scenario: Scenario) -> None:
    values = np.array(scenario["values"], dtype=float)
    for number, (method, decibels) in enumerate(scenario["psnr_db"].items()):
        color = FIELD_COLORS[number % len(FIELD_COLORS)]
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

"""The legend: colours are cameras, markers are methods."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from camkit.report.bench.row import Row
from camkit.report.bench.shown.looks import AREA_PER_GB, Looks
from camkit.report.figure import Figure
from camkit.runtime.plan.decision import DEVELOP

if TYPE_CHECKING:
    from matplotlib.lines import Line2D

GREY: Final = "#555555"
CAMERA, METHOD, LINES, LOWER = "camera", "method", "lines and sizes", "lower panels"
"""Heads of its parts."""
NAMES: Final = {
    DEVELOP: "develop (no reconstruction)",
    "wiener": "wiener (the bank)",
    "rl": "rl (Richardson-Lucy)",
    "admm-tv": "admm-tv",
    "S": "network S",
    "M": "network M",
    "L": "network L",
}


def draw_legend(figure: Figure, rows: Sequence[Row], looks: Looks, *, below: str) -> None:
    """Draw it to the right of all panels.

    Args:
        figure: With a layout that keeps room for it.
        rows: Those that are drawn.
        looks: Of their cameras and methods.
        below: What the lower panels show; empty where there are none.
    """
    entries = [_text(CAMERA), *(_line(color, name) for name, color in looks.colors.items())]
    entries.append(_text(METHOD))
    entries += [_dot(GREY, m, NAMES.get(name, name)) for name, m in looks.markers.items()]
    if any(row["variant"] for row in rows):
        entries.append(_dot(GREY, "o", "hollow: a variant", hollow=True))
    entries += [_text(LINES), _line("#bbbbbb", "Pareto front")]
    entries.append(_line(GREY, "input", width=1, linestyle="--"))
    if any(row.get("gain_se_psnr_db") for row in rows):
        entries.append(_line(GREY, "+-1 standard error\nof the gain", width=1, marker="_"))
    entries.append(_dot("#bbbbbb", "o", "1 GB peak memory", size_pt2=AREA_PER_GB))
    if below:
        entries += [_text(LOWER), _text(below)]
    legend = figure.legend(handles=entries, loc="outside right upper", labelspacing=0.55)
    for text in legend.get_texts():
        if text.get_text() in {CAMERA, METHOD, LINES, LOWER}:
            text.set_fontweight("bold")


def _text(text: str) -> "Line2D":
    return _line("none", text)


def _line(color: str, text: str, *, width: float = 3, **look: Any) -> "Line2D":
    from matplotlib.lines import Line2D

    return Line2D([], [], color=color, linewidth=width, label=text, **look)


def _dot(
    color: str, marker: str, text: str, *, size_pt2: float = 40, hollow: bool = False
) -> "Line2D":
    from matplotlib.lines import Line2D

    return Line2D(
        [],
        [],
        linestyle="none",
        marker=marker,
        markersize=math.sqrt(size_pt2),
        markerfacecolor="white" if hollow else color,
        markeredgecolor=color,
        label=text,
    )

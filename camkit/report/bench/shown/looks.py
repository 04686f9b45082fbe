"""Looks: one colour for every camera, one marker for every method; and the legend of them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from camkit.report.bench.row import Row
from camkit.report.figure import Figure
from camkit.runtime.plan.decision import DEVELOP

if TYPE_CHECKING:
    from matplotlib.lines import Line2D

CAMERA_COLORS: Final = (
    *("#0072b2", "#d55e00", "#009e73", "#a3348f"),
    *("#b58900", "#3aa0d8", "#444444", "#7a4a1d"),
)
"""Told apart by the colour-blind too (after Okabe and Ito 2008), and dark enough for text."""
MARKERS: Final = {
    DEVELOP: "X",
    "wiener": "s",
    "rl": "v",
    "admm-tv": "D",
    "physics": "P",
    "S": "^",
    "M": "o",
    "L": "h",
}
"""Of the usual methods, the same in every chart."""
SPARE_MARKERS: Final = ("p", "<", ">", "*", "d", "H", "8")
AREA_PER_GB: Final = 110.0
"""Marker area, in square points, of a peak memory of 1 GB."""
LEAST_AREA_PT2: Final = 22.0
"""Below, shapes cannot be told apart."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Looks:
    """Colours of cameras and markers of methods.

    Attributes:
        colors: Of every camera.
        markers: Of every method, by `method_name`.
    """

    colors: dict[str, str]
    markers: dict[str, str]

    def color(self, row: Row) -> str:
        """Return the colour of a row's camera."""
        return self.colors[row["camera"]]

    def marker(self, row: Row) -> str:
        """Return the marker of a row's method."""
        return self.markers[method_name(row)]


def looks_of(cameras: Sequence[str], rows: Iterable[Row]) -> Looks:
    """Return every camera a colour and every method a marker; where they run out, they repeat."""
    names = dict.fromkeys(method_name(row) for row in rows)
    common = [name for name in MARKERS if name in names]
    others = [name for name in names if name not in MARKERS]
    return Looks(
        colors={c: CAMERA_COLORS[n % len(CAMERA_COLORS)] for n, c in enumerate(cameras)},
        markers={name: MARKERS[name] for name in common}
        | {name: SPARE_MARKERS[n % len(SPARE_MARKERS)] for n, name in enumerate(others)},
    )


def method_name(row: Row) -> str:
    """Return the name of a row's method, with its bundle where that is not the camera's own."""
    name = str(row["size"] or row["method"])
    return name if row["bundle"] == row["camera"] else f"{row['bundle']} {name}"


def area_pt2(row: Row) -> float:
    """Return the area of a row's marker: its peak memory."""
    return max(AREA_PER_GB * float(row["peak_rss_mb"] or 0) / 1000, LEAST_AREA_PT2)


def reach_pt(row: Row) -> float:
    """Return the radius of a row's marker."""
    return math.sqrt(area_pt2(row)) / 2


def seconds_per_mp(row: Row, key: str = "seconds_median") -> float:
    """Return seconds of a row per megapixel of the capture that was timed."""
    return float(1e6 * row[key] / (row["width"] * row["height"]))


def draw_legend(figure: Figure, rows: Sequence[Row], looks: Looks, *, lower_text: str) -> None:
    """Draw it to the right of all panels.

    Args:
        figure: With a layout that keeps room for it.
        rows: Those that are drawn.
        looks: Of their cameras and methods.
        lower_text: What the lower panels show; empty where there are none.
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
    if lower_text:
        entries += [_text(LOWER), _text(lower_text)]
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

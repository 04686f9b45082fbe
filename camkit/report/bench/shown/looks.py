"""Looks: one colour for every camera, one marker for every method."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from camkit.report.bench.row import Row
from camkit.runtime.plan.decision import DEVELOP

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Looks:
    """How cameras and methods are drawn.

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
    known = [name for name in MARKERS if name in names]
    others = [name for name in names if name not in MARKERS]
    return Looks(
        colors={c: CAMERA_COLORS[n % len(CAMERA_COLORS)] for n, c in enumerate(cameras)},
        markers={name: MARKERS[name] for name in known}
        | {name: SPARE_MARKERS[n % len(SPARE_MARKERS)] for n, name in enumerate(others)},
    )


def method_name(row: Row) -> str:
    """Name the method of a row, with its bundle where that is not the camera's own."""
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

"""Texts beside their markers, where they cover neither markers nor each other."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from camkit.report.figure import Panel

if TYPE_CHECKING:
    from matplotlib.transforms import Bbox

NEAR_PT: Final = 3.5
FAR_PT: Final = 22.0
"""A label farther away than this gets a line to its marker."""


class Place(NamedTuple):
    """Place of a text beside its point: offset in points, and its alignments."""

    x_pt: float
    y_pt: float
    x_align: str
    y_align: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A text that wants a place.

    Attributes:
        text: What it says.
        point: What it says it of, in data.
        places: Where it may stand, the best first.
        color: Of the text.
        size_pt: Of the font.
        bold: Whether it is.
        gap_pt: From the point to the end of a line that leads there.
    """

    text: str
    point: tuple[float, float]
    places: Sequence[Place]
    color: str
    size_pt: float
    bold: bool = False
    gap_pt: float = 0.0


def places_around(reach_pt: float) -> list[Place]:
    """Return places around a marker, the best ones first."""
    places: list[Place] = []
    for gap in (NEAR_PT, 11.0, FAR_PT, 35.0, 53.0, 75.0, 100.0):
        offset_pt = reach_pt + gap
        places += [
            Place(0.7 * offset_pt, 0.7 * offset_pt, "left", "bottom"),
            Place(offset_pt, 0, "left", "center"),
            Place(0.7 * offset_pt, -0.7 * offset_pt, "left", "top"),
            Place(0, offset_pt, "center", "bottom"),
            Place(0, -offset_pt, "center", "top"),
            Place(-0.7 * offset_pt, 0.7 * offset_pt, "right", "bottom"),
            Place(-offset_pt, 0, "right", "center"),
            Place(-0.7 * offset_pt, -0.7 * offset_pt, "right", "top"),
        ]
    return places


def places_along(step_pt: float = 45.0, count: int = 8) -> list[Place]:
    """Return places above and below a level line, from its right end on."""
    ends = [-3.0 - step_pt * n for n in range(count)]
    return [p for x in ends for p in (Place(x, 2, "right", "bottom"), Place(x, -2, "right", "top"))]


def place_labels(panel: Panel, labels: Sequence[Label], obstacles: "list[Bbox]") -> None:
    """Draw labels, each where it shares least with what is taken and with the ones before it.

    Args:
        panel: With its final limits and layout.
        labels: In the order in which they choose.
        obstacles: Boxes on the canvas that nothing should cover; the labels' own are added.
    """
    for label in labels:
        size_px = _text_size_px(panel, label)
        x, y = panel.transData.transform(label.point)
        boxes = [_box_at((x, y), p, size_px, panel.figure.dpi) for p in label.places]
        costs = [_overlap(box, obstacles, panel.bbox) for box in boxes]
        best = costs.index(min(costs))
        _draw(panel, label, label.places[best])
        obstacles.append(boxes[best])


def _text_size_px(panel: Panel, label: Label) -> tuple[float, float]:
    renderer = panel.figure.canvas.get_renderer()  # type: ignore[attr-defined]
    text = panel.text(0, 0, label.text, fontsize=label.size_pt, fontweight=_weight(label))
    box = text.get_window_extent(renderer)
    text.remove()
    return float(box.width), float(box.height)


def _draw(panel: Panel, label: Label, place: Place) -> None:
    is_far = label.gap_pt > 0 and abs(complex(place.x_pt, place.y_pt)) > FAR_PT + label.gap_pt
    line = {
        "arrowstyle": "-",
        "color": label.color,
        "linewidth": 0.6,
        "alpha": 0.7,
        "shrinkA": 1.0,
        "shrinkB": label.gap_pt,
    }
    text = panel.annotate(
        label.text,
        label.point,
        xytext=place[:2],
        textcoords="offset points",
        ha=place.x_align,
        va=place.y_align,
        fontsize=label.size_pt,
        fontweight=_weight(label),
        color=label.color,
        arrowprops=line if is_far else None,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.6, "pad": 0.4},
        zorder=5,
    )
    text.set_in_layout(False)


def _weight(label: Label) -> str:
    return "bold" if label.bold else "normal"


def _box_at(
    point_px: tuple[float, float], place: Place, size_px: tuple[float, float], dpi: float
) -> "Bbox":
    """Return the box of a text of a known size beside a point."""
    from matplotlib.transforms import Bbox

    shares = {"left": 0.0, "bottom": 0.0, "center": 0.5, "right": 1.0, "top": 1.0}
    x_px = point_px[0] + place.x_pt * dpi / 72 - shares[place.x_align] * size_px[0]
    y_px = point_px[1] + place.y_pt * dpi / 72 - shares[place.y_align] * size_px[1]
    return Bbox.from_extents(x_px, y_px, x_px + size_px[0], y_px + size_px[1])


def _overlap(box: "Bbox", obstacles: Sequence["Bbox"], inside: "Bbox") -> float:
    """Return the area that a box shares with others, and that lies outside the panel."""
    area = float(box.width * box.height)
    return area - _shared(box, inside) + sum(_shared(box, other) for other in obstacles)


def _shared(one: "Bbox", other: "Bbox") -> float:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return max(float(wide), 0.0) * max(float(high), 0.0)

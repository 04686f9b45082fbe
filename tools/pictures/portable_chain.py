"""The chain of graphs of `camkit portable`, as a drawing."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from camkit.report.figure import BLUE, Figure, Panel, chart, hide_ticks, new_figure

SIZE_IN: Final = (6.9, 2.7)
BOX: Final = (1.3, 0.62)
"""Width and height of a graph."""
NAME_PT, TEXT_PT = 9.5, 7.5
HELPER_COLOR: Final = "#2e8b57"


class Graph(NamedTuple):
    """A graph in the drawing.

    Attributes:
        x: Its middle.
        y: Likewise.
        takes: What the host gives it, below it.
        gives: What it hands on, by the graphs that take it.
    """

    x: float
    y: float
    takes: str = ""
    gives: Mapping[str, str] = {}


GRAPHS: Final = {
    "block*": Graph(2.55, 3.2),
    "tile_*": Graph(5.75, 3.2),
    "warp*": Graph(8.95, 3.2),
    "spans": Graph(
        0.85, 1.0, "size_px, axis_px,\nred", {"place*": "", "block*": "index, turn,\nwindow"}
    ),
    "place*": Graph(2.55, 1.0, "place_mm", {"block*": "transfer,\npower, ..."}),
    "noise": Graph(4.3, 1.0, "iso", {"block*": "", "tile_*": "shot,\nread_variance"}),
    "kept": Graph(6.3, 1.0, "clipped\n(1, 1, h, w)", {"tile_*": "(1, 1, h, w)"}),
    "places": Graph(8.95, 1.0, "target_px", {"warp*": "places,\nleast, most"}),
}
"""By the name of its file; a star stands for several versions."""
DATA: Final = (
    (0.0, "block*", "host cuts blocks", "mosaic", "(b + 4, b + 4)"),
    ("block*", "tile_*", "host adds blocks", "planes", "(1, 6, h, w)"),
    ("tile_*", "warp*", "host joins tiles", "light", "(1, 3, h, w)"),
    ("warp*", 11.6, "host joins tiles", "picture", "(3, 512, 512)"),
)
"""Arrows of the host: from, to, what it does, name and shape of the data."""


@chart
def portable_chain() -> Figure:
    """Return the drawing: graphs as boxes, arrays as arrows."""
    figure = new_figure(*SIZE_IN)
    panel = figure.subplots()
    panel.set_axis_off()
    hide_ticks(panel)
    panel.set_xlim(0, 11.6)
    panel.set_ylim(-0.25, 4.1)
    for name, graph in GRAPHS.items():
        _draw_graph(panel, name, graph)
        for target, text in graph.gives.items():
            _draw_gift(panel, name, target, text)
    for start, end, step, name, shape in DATA:
        y, half = GRAPHS["block*"].y, BOX[0] / 2
        left = GRAPHS[start].x + half if isinstance(start, str) else start
        right = GRAPHS[end].x - half if isinstance(end, str) else end
        _arrow(panel, (left, y), (right, y))
        middle = (left + right) / 2
        panel.text(middle, y + 0.12, name, fontsize=NAME_PT, ha="center", va="bottom")
        panel.text(middle, y + 0.55, step, fontsize=TEXT_PT, ha="center", va="bottom", color="0.35")
        panel.text(middle, y - 0.14, shape, fontsize=TEXT_PT, ha="center", va="top")
    return figure


def _draw_graph(panel: Panel, name: str, graph: Graph) -> None:
    """Draw a box with its name, and below it what the host gives it."""
    from matplotlib.patches import FancyBboxPatch

    (width, height), color = BOX, HELPER_COLOR if graph.takes else BLUE
    corner = graph.x - width / 2, graph.y - height / 2
    panel.add_patch(
        FancyBboxPatch(
            corner, width, height, boxstyle="round,pad=0,rounding_size=0.1", fc=color, ec="none"
        )
    )
    at: Any = {"ha": "center", "va": "center", "color": "white", "family": "monospace"}
    panel.text(graph.x, graph.y, name, fontsize=NAME_PT, weight="bold", **at)
    lower = graph.y - height / 2 - 0.12
    panel.text(graph.x, lower, graph.takes, fontsize=TEXT_PT, ha="center", va="top", color="0.35")


def _draw_gift(panel: Panel, name: str, target: str, text: str) -> None:
    """Draw what a graph hands to another one."""
    start, end = GRAPHS[name], GRAPHS[target]
    if start.y == end.y:
        _arrow(panel, (start.x + BOX[0] / 2, start.y), (end.x - BOX[0] / 2, end.y))
        return
    reach = max(min(start.x - end.x, 0.45), -0.45)
    low, high = (start.x, start.y + BOX[1] / 2), (end.x + reach, end.y - BOX[1] / 2)
    _arrow(panel, low, high)
    x, y = ((a + b) / 2 for a, b in zip(low, high, strict=True))
    at: Any = {"ha": "center", "va": "center", "bbox": {"fc": "white", "ec": "none", "pad": 1}}
    panel.text(x, y, text, fontsize=TEXT_PT, **at)


def _arrow(panel: Panel, start: tuple[float, float], end: tuple[float, float]) -> None:
    style: Any = {"arrowstyle": "-|>", "color": "0.25", "shrinkA": 1, "shrinkB": 1}
    panel.annotate("", end, start, arrowprops=style)

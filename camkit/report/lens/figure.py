"""A chart as SVG and PNG, the same from run to run."""

import io
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIELD_COLORS: Final = ("#1f6fb4", "#2e8b57", "#c8452f", "#8855aa", "#b8860b", "#008b8b")
MARKS: Final = ("o", "+", "x", "s", "^", "d")
GRID_COLOR: Final = "#dddddd"


def wave_color(wavelength_um: float) -> str:
    """Give a colour that tells wavelengths apart: blue, green, red by thirds of the visible."""
    if wavelength_um < 0.5:
        return "#2f5fd0"
    if wavelength_um < 0.58:
        return "#2e8b57"
    return "#c8452f" if wavelength_um < 0.7 else "#7a2e1d"


def field_color(number: int) -> str:
    """Give the colour of a field."""
    return FIELD_COLORS[number % len(FIELD_COLORS)]


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Give an empty figure that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def to_svg(figure: "Figure") -> str:
    """Give the SVG text of a figure; its text stays text."""
    from matplotlib import rc_context

    stream = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "camkit"}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()


def to_png(figure: "Figure") -> bytes:
    """Give the PNG of a figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()

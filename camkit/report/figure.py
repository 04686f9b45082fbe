"""A chart as SVG and PNG, the same from run to run."""

import io
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIELD_COLORS: Final = ("#1f6fb4", "#2e8b57", "#c8452f", "#8855aa", "#b8860b", "#008b8b")
CHANNEL_COLORS: Final = {"R": "#c8452f", "G": "#2e8b57", "B": "#1f6fb4"}
MARKS: Final = ("o", "+", "x", "s", "^", "d")
GRID_COLOR: Final = "#dddddd"
_WAVE_COLORS: Final = (
    (0.40, (0x5B, 0x2A, 0x9D)),
    (0.47, (0x2F, 0x5F, 0xD0)),
    (0.50, (0x00, 0x8B, 0x8B)),
    (0.545, (0x2E, 0x8B, 0x57)),
    (0.59, (0xD0, 0x8A, 0x00)),
    (0.65, (0xC8, 0x2F, 0x2F)),
    (0.75, (0x6B, 0x1F, 0x1A)),
)


def wave_color(wavelength_um: float) -> str:
    """Return a colour that tells wavelengths apart: about that of the light, but darker."""
    at = [place for place, _ in _WAVE_COLORS]
    channels = zip(*(color for _, color in _WAVE_COLORS), strict=True)
    mixed = (round(float(np.interp(wavelength_um, at, channel))) for channel in channels)
    return "#" + "".join(f"{value:02x}" for value in mixed)


def field_color(number: int) -> str:
    """Return the colour of a field."""
    return FIELD_COLORS[number % len(FIELD_COLORS)]


def channel_color(name: str, number: int) -> str:
    """Return the colour of a channel of the sensor; of another, that of a field of that number."""
    return CHANNEL_COLORS.get(name, field_color(number))


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Return an empty figure that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def to_svg(figure: "Figure") -> str:
    """Return the SVG text of a figure; its text stays text."""
    from matplotlib import rc_context

    stream = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "camkit"}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()


def to_png(figure: "Figure") -> bytes:
    """Return the PNG of a figure."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()

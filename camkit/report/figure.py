"""Charts: their style and colours, and how they become SVG and PNG, the same from run to run.

A function that draws is marked with `chart`: while it runs, matplotlib's settings are `STYLE`.
"""

import io
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Final, ParamSpec

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.report.judge_need import require_judge

if TYPE_CHECKING:
    from matplotlib import axes, figure

    Panel = axes.Axes
    Figure = figure.Figure
else:  # matplotlib is imported by what draws
    Panel = Figure = object

FIELD_COLORS: Final = ("#1f6fb4", "#2e8b57", "#c8452f", "#8855aa", "#b8860b", "#008b8b")
CHANNEL_COLORS: Final = {"R": "#c8452f", "G": "#2e8b57", "B": "#1f6fb4"}
MARKS: Final = ("o", "+", "x", "s", "^", "d")
GRID_COLOR: Final = "#dddddd"
TICK_PT: Final = 7
STYLE: Final[Any] = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.labelsize": 8,
    "axes.titlesize": 9,
    "figure.labelsize": 8,
    "grid.color": GRID_COLOR,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1,
    "lines.markersize": 4,
}
BLUE: Final = FIELD_COLORS[0]
_WAVE_COLORS: Final = (
    (0.40, (0x5B, 0x2A, 0x9D)),
    (0.47, (0x2F, 0x5F, 0xD0)),
    (0.50, (0x00, 0x8B, 0x8B)),
    (0.545, (0x2E, 0x8B, 0x57)),
    (0.59, (0xD0, 0x8A, 0x00)),
    (0.65, (0xC8, 0x2F, 0x2F)),
    (0.75, (0x6B, 0x1F, 0x1A)),
)
_P = ParamSpec("_P")


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


def chart(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Return a function that draws in the style of all charts; pictures within have no grid."""

    @wraps(draw)
    def styled(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        require_judge()
        from matplotlib import rc_context

        with rc_context(STYLE):
            figure = draw(*args, **kwargs)
            for panel in figure.axes:
                panel.tick_params(labelsize=TICK_PT, which="both")
                if panel.images:
                    panel.grid(visible=False)
        return figure

    return styled


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that belongs to no window."""
    require_judge()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def hide_ticks(panel: Panel) -> None:
    """Remove the numbers beside a picture."""
    panel.set_xticks([])
    panel.set_yticks([])


def to_svg(figure: Figure) -> str:
    """Return the SVG text of a figure; its text stays text."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream, dpi = io.StringIO(), figure.dpi
    canvas: Any = FigureCanvasSVG(figure)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "camkit"}):
        # `savefig` draws twice: once to find the places, which this drawing finds as well
        canvas.print_svg(stream, metadata={"Date": None, "Creator": None})
    figure.set_dpi(dpi)  # an SVG is drawn at 72
    return stream.getvalue()


def to_png(figure: Figure) -> bytes:
    """Return the PNG of a figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = io.BytesIO()
    canvas: Any = FigureCanvasAgg(figure)
    canvas.print_png(stream, metadata={"Software": None})
    return stream.getvalue()


def levels_of(picture: NDArray[Any], enlarged: int = 1) -> NDArray[np.uint8]:
    """Return 8-bit levels (n h, n w, 3), blue first, of sRGB values (3, h, w), not smoothed."""
    codes = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)[::-1].transpose(1, 2, 0)
    return np.ascontiguousarray(codes.repeat(enlarged, axis=0).repeat(enlarged, axis=1))


def encode_png(levels: NDArray[np.uint8]) -> bytes:
    """Return the PNG of 8-bit levels (h, w, 3), blue first."""
    encoded, data = cv2.imencode(".png", levels)
    assert encoded  # an 8-bit picture of three channels always encodes
    return data.tobytes()

"""Residuals over the picture and over the radius, what was covered, and the distortion."""

from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibration.geometry.adjustment import rms
from camkit.calibration.geometry.camera_model import FloatGrid
from camkit.calibration.geometry.coverage import seen_cells
from camkit.calibration.geometry.geometry import Geometry
from camkit.report.figure import GRID_COLOR, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONGEST: Final = 0.12
"""Of the longer side of the picture: how long the longest arrow is drawn."""
FACTORS: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000)
WIDTH_IN: Final = 8.0
RINGS: Final = 12
_SMALL_PX: Final = 0.05
_SEEN: Final = "#1f6fb4"
_GUESSED: Final = "#c8452f"
_FITTED: Final = "#2e8b57"


def enlargement(residuals: FloatGrid, size: tuple[int, int]) -> int:
    """Return the factor by which residuals are enlarged: of a round number, so that all fit."""
    longest = float(np.linalg.norm(residuals, axis=-1).max())
    fitting = [n for n in FACTORS if n * longest <= LONGEST * max(size)]
    return fitting[-1] if fitting else FACTORS[0]


def draw_residuals(found: Geometry) -> bytes:
    """Draw every corner's held-out residual as an arrow, enlarged."""
    figure, axes = _picture_axes(found)
    rest = found.chosen.held_out
    factor = enlargement(rest, found.size)
    at, arrow = found.corners.reshape(-1, 2), rest.reshape(-1, 2) * factor
    axes.quiver(*at.T, *arrow.T, angles="xy", scale_units="xy", scale=1, color=_SEEN, width=0.0018)
    _circle(axes, found)
    axes.set_title(f"Seen less computed, picture left out; {factor} times enlarged", fontsize=10)
    return to_png(figure)


def draw_coverage(found: Geometry) -> bytes:
    """Draw where the board was seen."""
    figure, axes = _picture_axes(found)
    width, height = found.size
    cells = seen_cells(found.corners, found.size)
    # cells of 4 px may reach over the border of the picture
    axes.imshow(
        np.where(cells, 0.82, 1.0),
        cmap="gray",
        vmin=0,
        vmax=1,
        extent=(-0.5, cells.shape[1] * 4 - 0.5, cells.shape[0] * 4 - 0.5, -0.5),
        interpolation="nearest",
    )
    for view in found.corners:
        axes.plot(*view.T, ".", markersize=2.5)
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    _circle(axes, found)
    axes.set_title(
        f"Corners; grey: within a board, {found.coverage.share:.0%} of the picture", fontsize=10
    )
    return to_png(figure)


def draw_radii(found: Geometry) -> bytes:
    """Draw the held-out error of corners over their distance from the optical centre."""
    figure, axes = _chart_axes()
    rest = found.chosen.held_out.reshape(-1, 2)
    away = np.linalg.norm(found.corners.reshape(-1, 2) - found.camera.centre_px, axis=1)
    axes.plot(away, np.linalg.norm(rest, axis=1), ".", color=_SEEN, alpha=0.35, markersize=4)
    edges = np.linspace(0, away.max() * (1 + 1e-9), RINGS + 1)
    ring = np.digitize(away, edges) - 1
    full = [n for n in range(RINGS) if (ring == n).any()]
    middles = [(edges[n] + edges[n + 1]) / 2 for n in full]
    axes.plot(middles, [rms(rest[ring == n]) for n in full], color=_GUESSED, label="rms of a ring")
    axes.set_xlabel("distance from the optical centre, px")
    axes.set_ylabel("held-out error, px")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False)
    return to_png(figure)


def draw_distortion(found: Geometry) -> bytes:
    """Draw how far points are moved along the radius, and what the polynomial misses."""
    figure, (upper, lower) = _two_axes()
    profile, radial = found.profile, found.radial
    placed = np.linspace(0, profile.covered_px, 300)
    ideal = profile.ideal_px(placed)
    unit = ideal / radial.radius_px
    powers = 2 * np.arange(4) + 1
    fitted = unit[:, None] ** powers @ np.array(radial.coefficients) * radial.radius_px
    upper.plot(placed, placed - ideal, color=_SEEN, label=found.camera.model.name)
    upper.plot(placed, fitted - ideal, "--", color=_FITTED, label="polynomial of eq. 6.10")
    upper.set_ylabel("moved outwards, px")
    upper.legend(frameon=False)
    lower.plot(placed, fitted - placed, color=_FITTED)
    lower.set_ylabel("polynomial off, px")
    lower.set_ylim(*_at_least(lower.get_ylim()))
    lower.set_xlabel("distance from the optical centre on the picture, px")
    for axes in (upper, lower):
        axes.axvspan(
            profile.covered_px, found.coverage.corner_px, color=_GUESSED, alpha=0.12, linewidth=0
        )
        axes.set_xlim(0, max(found.coverage.corner_px, profile.covered_px))
    return to_png(figure)


def _at_least(limits: tuple[float, float]) -> tuple[float, float]:
    """Return limits of an axis that make nothing of what is nothing."""
    low, high = limits
    return min(low, -_SMALL_PX), max(high, _SMALL_PX)


def _picture_axes(found: Geometry) -> "tuple[Figure, Axes]":
    """Return axes that are the picture, y down."""
    width, height = found.size
    figure = new_figure(WIDTH_IN, WIDTH_IN * min(1.5, height / width) + 0.6)
    axes = figure.add_subplot()
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xlabel("x, px")
    axes.set_ylabel("y, px")
    return figure, axes


def _chart_axes() -> "tuple[Figure, Axes]":
    figure = new_figure(WIDTH_IN, 3.6)
    axes = figure.add_subplot()
    axes.grid(color=GRID_COLOR)
    return figure, axes


def _two_axes() -> "tuple[Figure, tuple[Axes, Axes]]":
    figure = new_figure(WIDTH_IN, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for axes in (upper, lower):
        axes.grid(color=GRID_COLOR)
    return figure, (upper, lower)


def _circle(axes: "Axes", found: Geometry) -> None:
    """Mark the optical centre and the covered radius."""
    x, y = found.camera.centre_px
    around = np.linspace(0, 2 * np.pi, 361)
    radius = found.coverage.radius_px
    axes.plot(x + radius * np.cos(around), y + radius * np.sin(around), color=_GUESSED, linewidth=1)
    axes.plot([x], [y], "+", color=_GUESSED)

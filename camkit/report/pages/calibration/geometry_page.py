"""The page of a camera's geometry: residuals, what was seen, the distortion, models tried."""

from typing import Final

import numpy as np

from camkit.calibration.geometry.adjustment import rms
from camkit.calibration.geometry.camera_model import FloatGrid
from camkit.calibration.geometry.coverage import seen_cells
from camkit.calibration.geometry.geometry import Geometry
from camkit.report.figure import FIELD_COLORS, Figure, Panel, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

LONGEST: Final = 0.12
"""Of the longer side of the picture: how long the longest arrow is drawn."""
FACTORS: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000)
WIDTH_IN: Final = 8.0
RINGS: Final = 12
_SMALL_PX: Final = 0.05
_MEASURED, _FITTED, _EXTRAPOLATED = FIELD_COLORS[:3]
_CHOICE: Final = (
    "The simplest is taken whose held-out error is not meaningfully worse than the least, and "
    "whose distortion does not fold inside the picture."
)


def geometry_html(geometry: Geometry) -> str:
    """Return the page."""
    coverage = geometry.coverage
    reach = (
        "The board reached the corners of the picture."
        if coverage.is_whole
        else f"Nothing was seen beyond {coverage.radius_px:.0f} px from the optical centre (the "
        f"circle), while the picture reaches to {coverage.corner_px:.0f} px. The distortion there "
        "is a guess: do not use it."
    )
    arrows = (
        "Every picture left out once: the camera is that of the others, the pose its own. "
        f"Arrows are {enlargement(geometry.best.held_out, geometry.size)} times enlarged; the "
        "circle marks what was covered, the cross the optical centre."
    )
    missed = (
        f"The polynomial of undistort misses the model by up to {geometry.radial.residual_px:.3f} "
        "px within what was seen. Red: not seen."
    )
    residuals = Picture("Residuals over the picture", to_png(draw_residuals(geometry)))
    radii = Picture("Held-out error", to_png(draw_radii(geometry)))
    covered = Picture("Covered area", to_png(draw_coverage(geometry)))
    distortion = Picture("Distortion along the radius", to_png(draw_distortion(geometry)))
    sections = [
        Section("Result", (sentences(*geometry.notes), _result(geometry))),
        Section("Residuals", (arrows, residuals)),
        Section("Residuals over the radius", (radii,)),
        Section("What was seen", (reach, covered)),
        Section("Distortion", (missed, distortion)),
        Section("Models", (_CHOICE, _models(geometry))),
        Section("Pictures", (_pictures(geometry),)),
    ]
    return to_html(Page(title="camkit calibrate geometry", sections=sections))


def _result(geometry: Geometry) -> Table:
    camera, selection, radial = geometry.camera, geometry.best, geometry.radial
    rows = [
        ("pictures with the board", f"{len(geometry.corners)} of {len(geometry.views)}"),
        ("board, inner corners", str(geometry.board)),
        ("picture, px", f"{geometry.size[0]} x {geometry.size[1]}"),
        ("model", camera.model.name),
        ("focal length, px", f"{camera.focal_px:.3f}"),
        ("optical centre x, y, px", "{:.3f}, {:.3f}".format(*camera.centre_px)),
        ("coefficients", ", ".join(f"{k:.6g}" for k in camera.coefficients)),
        ("error, px rms", f"{selection.fit.rms_px:.4f}"),
        ("held-out error, px rms", f"{selection.rms_px:.4f}"),
        ("worst picture, px rms", f"{selection.worst_px:.4f}"),
        ("covered radius, px", f"{geometry.coverage.radius_px:.1f}"),
        ("radial coefficients (eq. 6.10)", ", ".join(f"{k:.6g}" for k in radial.coefficients)),
        ("in units of, px", f"{radial.radius_px:.3f}"),
    ]
    return Table(rows=rows)


def _models(geometry: Geometry) -> Table:
    rows = [
        (
            one.fit.camera.model.name + (" (taken)" if one is geometry.best else ""),
            str(len(one.fit.camera.model.free)),
            f"{one.fit.rms_px:.4f}",
            f"{one.rms_px:.4f}",
            f"{one.worst_px:.4f}",
        )
        for one in geometry.candidates
    ]
    return Table(header=("model", "coefficients", "rms, px", "held out", "worst"), rows=rows)


def _pictures(geometry: Geometry) -> Table:
    rows: list[tuple[str, ...]] = []
    number = 0
    for view in geometry.views:
        if view.corners is None:
            rows.append((view.path.name, "no board", ""))
            continue
        errors = (geometry.best.fit.residuals[number], geometry.best.held_out[number])
        rows.append((view.path.name, *(f"{rms(error):.4f}" for error in errors)))
        number += 1
    return Table(header=("picture", "rms, px", "held out"), rows=rows)


def enlargement(residuals: FloatGrid, size: tuple[int, int]) -> int:
    """Return the factor by which residuals are enlarged: of a round number, so that all fit."""
    longest = float(np.linalg.norm(residuals, axis=-1).max())
    fitting = [n for n in FACTORS if n * longest <= LONGEST * max(size)]
    return fitting[-1] if fitting else FACTORS[0]


@chart
def draw_residuals(geometry: Geometry) -> Figure:
    """Draw every corner's held-out residual as an arrow, enlarged."""
    figure, panel = _picture_panel(geometry)
    rest = geometry.best.held_out
    factor = enlargement(rest, geometry.size)
    at, arrow = geometry.corners.reshape(-1, 2), rest.reshape(-1, 2) * factor
    panel.quiver(
        *at.T, *arrow.T, angles="xy", scale_units="xy", scale=1, color=_MEASURED, width=0.0018
    )
    _circle(panel, geometry)
    panel.set_title(f"Seen less computed, picture left out; {factor} times enlarged")
    return figure


@chart
def draw_coverage(geometry: Geometry) -> Figure:
    """Draw where the board was seen."""
    figure, panel = _picture_panel(geometry)
    width, height = geometry.size
    cells = seen_cells(geometry.corners, geometry.size)
    # cells of 4 px may reach over the border of the picture
    panel.imshow(
        np.where(cells, 0.82, 1.0),
        cmap="gray",
        vmin=0,
        vmax=1,
        extent=(-0.5, cells.shape[1] * 4 - 0.5, cells.shape[0] * 4 - 0.5, -0.5),
        interpolation="nearest",
    )
    for view in geometry.corners:
        panel.plot(*view.T, ".", markersize=2.5)
    panel.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    _circle(panel, geometry)
    panel.set_title(f"Corners; grey: within a board, {geometry.coverage.share:.0%} of the picture")
    return figure


@chart
def draw_radii(geometry: Geometry) -> Figure:
    """Draw the held-out error of corners over their distance from the optical centre."""
    figure = new_figure(WIDTH_IN, 3.6)
    panel = figure.add_subplot()
    rest = geometry.best.held_out.reshape(-1, 2)
    radii_px = np.linalg.norm(geometry.corners.reshape(-1, 2) - geometry.camera.centre_px, axis=1)
    panel.plot(radii_px, np.linalg.norm(rest, axis=1), ".", color=_MEASURED, alpha=0.35)
    edges = np.linspace(0, radii_px.max() * (1 + 1e-9), RINGS + 1)
    ring = np.digitize(radii_px, edges) - 1
    full = [n for n in range(RINGS) if (ring == n).any()]
    middles = [(edges[n] + edges[n + 1]) / 2 for n in full]
    panel.plot(
        middles, [rms(rest[ring == n]) for n in full], color=_EXTRAPOLATED, label="rms of a ring"
    )
    panel.set(xlabel="distance from the optical centre, px", ylabel="held-out error, px")
    panel.set_ylim(bottom=0)
    panel.legend()
    return figure


@chart
def draw_distortion(geometry: Geometry) -> Figure:
    """Draw how far points are moved along the radius, and what the polynomial misses."""
    figure = new_figure(WIDTH_IN, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    profile, radial = geometry.profile, geometry.radial
    distorted_px = np.linspace(0, profile.covered_px, 300)
    ideal = profile.ideal_px(distorted_px)
    unit = ideal / radial.radius_px
    powers = 2 * np.arange(4) + 1
    fitted = unit[:, None] ** powers @ np.array(radial.coefficients) * radial.radius_px
    upper.plot(
        distorted_px, distorted_px - ideal, color=_MEASURED, label=geometry.camera.model.name
    )
    upper.plot(distorted_px, fitted - ideal, "--", color=_FITTED, label="polynomial of eq. 6.10")
    upper.set_ylabel("moved outwards, px")
    upper.legend()
    lower.plot(distorted_px, fitted - distorted_px, color=_FITTED)
    lower.set_ylabel("polynomial off, px")
    low, high = lower.get_ylim()  # that make nothing of what is nothing
    lower.set(
        ylim=(min(low, -_SMALL_PX), max(high, _SMALL_PX)),
        xlabel="distance from the optical centre on the picture, px",
    )
    covered_px, corner_px = profile.covered_px, geometry.coverage.corner_px
    for panel in (upper, lower):
        panel.axvspan(covered_px, corner_px, color=_EXTRAPOLATED, alpha=0.12, linewidth=0)
        panel.set_xlim(0, max(corner_px, covered_px))
    return figure


def _picture_panel(geometry: Geometry) -> tuple[Figure, Panel]:
    """Return a panel that is the picture, y down."""
    width, height = geometry.size
    figure = new_figure(WIDTH_IN, WIDTH_IN * min(1.5, height / width) + 0.6)
    panel = figure.add_subplot()
    panel.set(
        xlim=(-0.5, width - 0.5),
        ylim=(height - 0.5, -0.5),
        aspect="equal",
        xlabel="x, px",
        ylabel="y, px",
    )
    return figure, panel


def _circle(panel: Panel, geometry: Geometry) -> None:
    """Mark the optical centre and the covered radius."""
    x, y = geometry.camera.centre_px
    turn_rad = np.linspace(0, 2 * np.pi, 361)
    radius = geometry.coverage.radius_px
    panel.plot(x + radius * np.cos(turn_rad), y + radius * np.sin(turn_rad), color=_EXTRAPOLATED)
    panel.plot([x], [y], "+", color=_EXTRAPOLATED)

"""The page of imported kernels: where they lie, which way they point, what was normalised."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.psf_import.clean_kernels import ImportedPsf
from camkit.calibration.psf_import.kernel_stack import FloatGrid
from camkit.calibration.psf_import.psf_facts import places_text
from camkit.psf import FrozenPsf
from camkit.report.figure import Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html
from camkit.runtime.bank.psf import FieldKernels

_FLOOR: Final = 1e-4
_CELL: Final = 0.9
_WIDTH_IN: Final = 9.0
_MAP: Final = (
    "Every kernel in its place, as the picture shows a point there: columns to the right, rows "
    "down, the dot is the optical axis. Logarithm of the light, four decades."
)
_IMPULSE: Final = (
    "A point of light up left of the axis, as the camera will photograph it: the cross is where "
    "the point is, right and down are those of the picture. If tails point another way than in a "
    "photograph of a point there, the files run the other way: import them with another flip."
)
_PLACE: Final = 0.7


def psf_field_html(result: ImportedPsf, source: str) -> str:
    """Return the page."""
    psf, record = result.psf, result.to_record()
    summary = f"{source}: {places_text(psf)}."
    estimated = "estimated" if result.is_estimated else "as stated"
    rows = [(name.replace("_", " "), str(value)) for name, value in record["normalised"].items()]
    rows += [
        (f"uncertainty: {name.replace('_', ' ')} ({estimated})", str(value))
        for name, value in record["uncertainty"].items()
        if name != "estimated"
    ]
    sections = [
        Section(
            "Where they lie",
            (sentences(summary, *result.notes), Picture(_MAP, to_png(draw_field(psf)))),
        ),
        Section("Which way they point", (Picture(_IMPULSE, to_png(draw_impulse(psf))),)),
        Section("What was normalised", (Table(header=("what", "value"), rows=rows),)),
    ]
    return to_html(Page(title="An imported point spread function", sections=sections))


@chart
def draw_field(psf: FrozenPsf) -> Figure:
    """Draw every kernel where it lies on the sensor; of a lens of revolution side by side."""
    x_mm, y_mm = _positions(psf)
    is_radial = psf.symmetry == "radial"
    if is_radial:
        x_mm, y_mm = y_mm, x_mm
    spacing = min(_step(x_mm), _step(y_mm))
    reach = (np.ptp(x_mm) + 2 * spacing, np.ptp(y_mm) + 2 * spacing)
    scale = float(np.clip(reach[1] / reach[0], 0.3, 2.0))
    figure = new_figure(_WIDTH_IN, max(3.0, _WIDTH_IN * scale))
    panel = figure.subplots()
    half = _CELL * spacing / 2
    for kernels, x, y in zip(psf.kernels[:, 0], x_mm, y_mm, strict=True):
        panel.imshow(_colour_picture(kernels), extent=(x - half, x + half, y + half, y - half))
    panel.plot(0, 0, ".", color="tab:red", markersize=4)
    panel.set(
        xlim=(x_mm.min() - spacing, x_mm.max() + spacing),
        ylim=(y_mm.max() + spacing, y_mm.min() - spacing),
        xlabel="below the axis, mm" if is_radial else "x, mm to the right",
        ylabel="" if is_radial else "y, mm down",
        aspect="equal",
        facecolor="#ddd",
    )
    if is_radial:
        panel.set_yticks([])
    return figure


@chart
def draw_impulse(psf: FrozenPsf) -> Figure:
    """Draw a point off the axis, up left, as the PSF blurs it."""
    x_mm, y_mm = _positions(psf)
    reach = float(np.hypot(x_mm, y_mm).max())
    x, y = (_PLACE * axis.min() if np.ptp(axis) else 0.0 for axis in (x_mm, y_mm))
    if psf.symmetry == "radial":
        x = y = -_PLACE * reach / np.sqrt(2)
    lookup = FieldKernels(
        kernels=psf.kernels[:, 0],
        field_heights_mm=psf.field_heights_mm,
        symmetry=psf.symmetry,
        grid_x_mm=psf.grid_x_mm,
        grid_y_mm=psf.grid_y_mm,
    )
    kernels = lookup.at(x, y)
    figure = new_figure(5.0, 4.6)
    panel = figure.subplots()
    half = kernels.shape[-1] / 2
    panel.imshow(_colour_picture(kernels), extent=(-half, half, half, -half))
    panel.plot(0, 0, "+", color="tab:cyan", markersize=14)
    panel.set(title=f"x = {x:.3g} mm, y = {y:.3g} mm", xlabel="px, right", ylabel="px, down")
    return figure


def _positions(psf: FrozenPsf) -> tuple[FloatGrid, FloatGrid]:
    if psf.grid_x_mm is None or psf.grid_y_mm is None:
        return np.zeros_like(psf.field_heights_mm), psf.field_heights_mm
    y, x = np.meshgrid(psf.grid_y_mm, psf.grid_x_mm, indexing="ij")
    return x.ravel(), y.ravel()


def _step(positions_mm: FloatGrid) -> float:
    steps = np.diff(np.unique(positions_mm))
    return float(steps.min()) if steps.size else float("inf") if positions_mm.size > 1 else 1.0


def _colour_picture(kernels: FloatArray) -> FloatGrid:
    """Return (h, w, 3) red, green, blue of (wavelength, h, w), on a logarithmic scale."""
    ends = (-1, len(kernels) // 2, 0)  # the longest wavelength is shown red
    picture = np.stack([kernels[end] for end in ends], axis=-1).astype(np.float64)
    picture /= picture.max()
    return np.asarray(1 - np.log(np.maximum(picture, _FLOOR)) / np.log(_FLOOR))

"""Spot diagrams: one panel per field, all to one scale, wavelengths by colour and mark."""

import math

import torch

from camkit.report.figure import MARKS, Figure, Panel, chart, new_figure, wave_color
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

COLUMNS = 5


@chart
def draw_spots(facts: LensFacts) -> Figure:
    """Draw the spots about the chief ray of the reference wavelength, with the Airy circle."""
    fields = len(facts.lens.field_angles_rad)
    columns = min(COLUMNS, max(fields, 1))
    rows = math.ceil(fields / columns)
    reach_um = float(torch.nan_to_num(facts.max_mm).max()) * UM_PER_MM
    reach_um = 1.1 * max(reach_um, 1.5 * float(facts.airy_mm.max()) * UM_PER_MM, 1e-3)
    figure = new_figure(max(2.6 * columns, 5.2), 3.0 * rows + 0.5)
    for i in range(fields):
        panel = figure.add_subplot(rows, columns, i + 1)
        _draw_field(panel, facts, i, reach_um)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    return figure


def _draw_field(panel: Panel, facts: LensFacts, field: int, reach_um: float) -> None:
    from matplotlib.patches import Circle

    spots = facts.spots
    angle = to_degrees(facts.lens.field_angles_rad[field])
    for j, wave in enumerate(facts.lens.wavelengths_um):
        alive = spots.weight[field, j] > 0
        x = spots.x_mm[field, j][alive] * UM_PER_MM
        y = (spots.y_mm[field, j][alive] - spots.chief_y_mm[field]) * UM_PER_MM
        mark = MARKS[j % len(MARKS)]
        size = 9 if len(x) < 400 else 3
        panel.scatter(
            x.detach(),
            y.detach(),
            s=size,
            marker=mark,
            linewidths=0.6,
            facecolors="none" if mark == "o" else wave_color(wave),
            edgecolors=wave_color(wave) if mark in "os^d" else None,
            label=f"{wave:.4g} µm",
        )
    reference_um = facts.lens.reference_wavelength_um
    nearest = min(
        range(len(facts.lens.wavelengths_um)),
        key=lambda j: abs(facts.lens.wavelengths_um[j] - reference_um),
    )
    radius = float(facts.airy_mm[nearest]) * UM_PER_MM
    if math.isfinite(radius):
        circle = Circle((0, 0), radius, fill=False, color="black", linewidth=0.8, label="Airy disc")
        panel.add_patch(circle)
    rms = float(facts.rms_mm[field, nearest]) * UM_PER_MM
    text = "no light" if math.isnan(rms) else f"RMS {rms:.4g} µm"
    panel.set_title(f"{angle:.4g}°   {text}")
    panel.set_xlim(-reach_um, reach_um)
    panel.set_ylim(-reach_um, reach_um)
    panel.set_aspect("equal")
    panel.set_xlabel("µm")

"""Longitudinal aberration, axial colour and lateral colour."""

from typing import TYPE_CHECKING, Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.curves import (
    axial_colour_mm,
    lateral_colour_mm,
    longitudinal_mm,
)
from camkit.report.figure import GRID_COLOR, new_figure, wave_color
from camkit.report.lens.facts import LensFacts
from camkit.units import UM_PER_MM

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS: Final = 25


def draw_colour(facts: LensFacts) -> "Figure":
    """Draw the three charts."""
    lens, waves = facts.lens, facts.wavelengths_um
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    zone = torch.linspace(0.02, 1, _POINTS, dtype=torch.float64)
    cross = longitudinal_mm(lens, zone, waves)
    for j, wave in enumerate(lens.wavelengths_um):
        left.plot(cross[j], zone, color=wave_color(wave), label=f"{wave:.4g} µm")
    left.axvline(0, color="black", linewidth=0.8)
    left.set_title("axial rays cross the axis at, mm from the sensor", fontsize=8.5)
    left.set_ylabel("height in the entrance pupil")
    left.legend(fontsize=7, frameon=False)
    span = _span(waves)
    middle.plot(span, axial_colour_mm(lens, span) * UM_PER_MM, color="#333333")
    middle.plot(waves, axial_colour_mm(lens, waves) * UM_PER_MM, "o", color="#333333", markersize=4)
    middle.axhline(0, color="black", linewidth=0.8)
    middle.set_title("axial colour: paraxial focus, µm", fontsize=9)
    middle.set_xlabel("wavelength, µm")
    slopes = _field_span(facts)
    beside = lateral_colour_mm(lens, slopes, waves, facts.pupil.definition) * UM_PER_MM
    for j, wave in enumerate(lens.wavelengths_um):
        degrees = torch.rad2deg(torch.atan(slopes))
        right.plot(degrees, beside[:, j], color=wave_color(wave), label=f"{wave:.4g} µm")
    right.set_title("lateral colour of the chief ray, µm", fontsize=9)
    right.set_xlabel("field angle, degrees")
    right.legend(fontsize=7, frameon=False)
    for panel in (left, middle, right):
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    return figure


def _span(waves: Tensor) -> Tensor:
    return torch.linspace(float(waves.min()), float(waves.max()), _POINTS, dtype=torch.float64)


def _field_span(facts: LensFacts) -> Tensor:
    largest = max(facts.lens.field_angles_rad)
    return torch.tan(torch.linspace(0, largest, _POINTS, dtype=torch.float64))

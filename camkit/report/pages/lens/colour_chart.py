"""Longitudinal aberration, axial colour and lateral colour."""

from typing import Final

import torch

from camkit.models_def.optics.analysis.curves import (
    axial_colour_mm,
    lateral_colour_mm,
    longitudinal_mm,
)
from camkit.report.figure import Figure, chart, new_figure, wave_color
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM

_POINTS: Final = 25


@chart
def draw_colour(facts: LensFacts) -> Figure:
    """Draw the three charts."""
    lens, waves = facts.lens, facts.wavelengths_um
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    zone = torch.linspace(0.02, 1, _POINTS, dtype=torch.float64)
    cross = longitudinal_mm(lens, zone, waves)
    slopes = torch.tan(torch.linspace(0, max(lens.field_angles_rad), _POINTS, dtype=torch.float64))
    degrees = torch.rad2deg(torch.atan(slopes))
    beside = lateral_colour_mm(lens, slopes, waves, facts.pupil.definition) * UM_PER_MM
    for j, wave in enumerate(lens.wavelengths_um):
        color, label = wave_color(wave), f"{wave:.4g} µm"
        left.plot(cross[j], zone, color=color, label=label)
        right.plot(degrees, beside[:, j], color=color, label=label)
    left.axvline(0, color="black", linewidth=0.8)
    left.set_title("axial rays cross the axis at, mm from the sensor")
    left.set_ylabel("height in the entrance pupil")
    span = torch.linspace(float(waves.min()), float(waves.max()), _POINTS, dtype=torch.float64)
    middle.plot(span, axial_colour_mm(lens, span) * UM_PER_MM, color="#333333")
    middle.plot(waves, axial_colour_mm(lens, waves) * UM_PER_MM, "o", color="#333333")
    middle.axhline(0, color="black", linewidth=0.8)
    middle.set_title("axial colour: paraxial focus, µm")
    middle.set_xlabel("wavelength, µm")
    right.set_title("lateral colour of the chief ray, µm")
    right.set_xlabel("field angle, degrees")
    left.legend()
    right.legend()
    return figure

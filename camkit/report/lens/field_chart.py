"""Field curvature, distortion and relative illumination over the field."""

import math
from typing import TYPE_CHECKING, Final

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.curves import distortion, field_curvature
from camkit.models_def.optics.analysis.illumination import relative_illumination_of
from camkit.report.figure import GRID_COLOR, new_figure, wave_color
from camkit.report.lens.facts import LensFacts
from camkit.units import to_degrees

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS: Final = 25
_LIGHT_POINTS: Final = 13


def draw_field(facts: LensFacts) -> "Figure":
    """Draw the three curves up to the largest field."""
    lens = facts.lens
    largest = max(lens.field_angles_rad)
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    for panel, title in (
        (left, "field curvature, mm from the sensor"),
        (middle, "distortion, %"),
        (right, "relative illumination"),
    ):
        panel.set_title(title, fontsize=9)
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    left.set_ylabel("field angle, degrees")
    if not largest:
        middle.set_xlabel("the file has no field off the axis", fontsize=8)
        return figure
    # not the axis itself, where distortion is no number
    angles = torch.linspace(largest / 100, largest, _POINTS, dtype=torch.float64)
    degrees = torch.rad2deg(angles)
    foci = field_curvature(lens, torch.tan(angles), facts.wavelengths_um, facts.pupil.definition)
    share = distortion(lens, torch.tan(angles), facts.wavelengths_um, facts.pupil.definition)
    for j, wave in enumerate(lens.wavelengths_um):
        color, name = wave_color(wave), f"{wave:.4g} µm"
        left.plot(foci.tangential_mm[:, j], degrees, color=color, label=f"{name} T")
        left.plot(foci.sagittal_mm[:, j], degrees, color=color, linestyle="--", label=f"{name} S")
        middle.plot(100 * share[:, j], degrees, color=color, label=name)
    left.axvline(0, color="black", linewidth=0.8)
    middle.axvline(0, color="black", linewidth=0.8)
    left.legend(fontsize=7, frameon=False)
    middle.legend(fontsize=7, frameon=False)
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    few = torch.linspace(0, largest, _LIGHT_POINTS, dtype=torch.float64)
    try:
        light = relative_illumination_of(lens, torch.tan(few), reference)[:, 0]
    except ContractError:
        light = torch.full_like(few, math.nan)
    right.plot(torch.rad2deg(few), light, color="#333333")
    cos4 = torch.cos(few) ** 4
    right.plot(torch.rad2deg(few), cos4, color="#999999", linestyle=":", label="cos$^4$")
    right.set_ylim(0, max(1.05, float(torch.nan_to_num(light).max()) * 1.05))
    right.set_xlim(0, to_degrees(largest))
    right.set_xlabel("field angle, degrees")
    right.legend(fontsize=7, frameon=False)
    return figure

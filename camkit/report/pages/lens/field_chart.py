"""Field curvature, distortion and relative illumination over the field."""

import math
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.curves import distortion, field_curvature
from camkit.models_def.optics.analysis.illumination import relative_illumination_of
from camkit.report.figure import Figure, Panel, chart, new_figure, wave_color
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import to_degrees

_POINTS: Final = 25
_LIGHT_POINTS: Final = 13
_TITLES: Final = (
    *("field curvature, mm from the sensor", "distortion, %", "relative illumination"),
)


@chart
def draw_field(facts: LensFacts) -> Figure:
    """Draw the three curves up to the largest field."""
    lens = facts.lens
    largest = max(lens.field_angles_rad)
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    for panel, title in zip((left, middle, right), _TITLES, strict=True):
        panel.set_title(title)
    left.set_ylabel("field angle, degrees")
    if not largest:
        middle.set_xlabel("the file has no field off the axis")
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
    for panel in (left, middle):
        panel.axvline(0, color="black", linewidth=0.8)
        panel.legend()
    _draw_light(right, facts, largest)
    return figure


def _draw_light(panel: Panel, facts: LensFacts, largest_rad: float) -> None:
    reference = torch.tensor([facts.lens.reference_wavelength_um], dtype=torch.float64)
    few = torch.linspace(0, largest_rad, _LIGHT_POINTS, dtype=torch.float64)
    try:
        light = relative_illumination_of(facts.lens, torch.tan(few), reference)[:, 0]
    except ContractError:
        light = torch.full_like(few, math.nan)
    panel.plot(torch.rad2deg(few), light, color="#333333")
    cos4 = torch.cos(few) ** 4
    panel.plot(torch.rad2deg(few), cos4, color="#999999", linestyle=":", label="cos$^4$")
    panel.set_ylim(0, max(1.05, float(torch.nan_to_num(light).max()) * 1.05))
    panel.set_xlim(0, to_degrees(largest_rad))
    panel.set_xlabel("field angle, degrees")
    panel.legend()

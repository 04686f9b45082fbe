"""The charts of a lens's curves: MTF, over the field, over colour, third-order sums."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import field_slope
from camkit.models_def.optics.analysis.curves import (
    axial_colour_mm,
    distortion,
    field_curvature,
    lateral_colour_mm,
    longitudinal_mm,
)
from camkit.models_def.optics.analysis.mtf import (
    Mtf,
    diffraction_limit,
    geometric_mtf,
    mtf_of_psf,
)
from camkit.models_def.optics.analysis.sampling import Pupil, rim_samples
from camkit.models_def.optics.analysis.spots import spot_diagram
from camkit.models_def.optics.analysis.wave_psf import widest_aperture
from camkit.models_def.optics.analysis.wavefront import trace_wavefront
from camkit.models_def.optics.render.illumination import relative_illumination_of
from camkit.report.figure import Figure, Panel, chart, field_color, new_figure, wave_color
from camkit.report.pages.lens.left_out import left_out_text
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

MAX_CYCLES_PER_MM: Final = 100.0
_FREQUENCIES: Final = 101
_DENSE_SAMPLING: Final = "gauss:24x48"
_POINTS: Final = 25
_LIGHT_POINTS: Final = 13
_OF_FIELD: Final = (
    *("field curvature, mm from the sensor", "distortion, %", "relative illumination"),
)
_SUMS: Final = {
    "I spherical": "#c8452f",
    "II coma": "#b8860b",
    "III astigmatism": "#2e8b57",
    "IV Petzval": "#1f6fb4",
    "V distortion": "#8855aa",
    "C_L axial colour": "#777777",
    "C_T lateral colour": "#bbbbbb",
}


@chart
def draw_mtf(facts: LensFacts) -> Figure:
    """Draw contrast, by waves or by rays times the diffraction limit, as each field needs."""
    numbers = facts.drawn_fields()
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    if numbers:
        cycles, mtf, limit = trace_mtf(facts, numbers)
        _draw_contrast(panel, facts, numbers, (cycles, mtf, limit))
        panel.set(xlim=(0, float(cycles[-1])))
    assert facts.image is not None
    by_rays = [
        f"{to_degrees(facts.lens.field_angles_rad[i]):.4g}°"
        for i in numbers
        if facts.image.images[i] is None
    ]
    how = "diffraction PSF" if len(by_rays) < len(numbers) else "rays times diffraction limit"
    if by_rays and len(by_rays) < len(numbers):
        how += f" (rays times limit: {', '.join(by_rays)})"
    panel.set(ylim=(0, 1.02), ylabel="contrast")
    panel.set_xlabel("\n".join(filter(None, ("cycles/mm", left_out_text(facts)))))
    panel.set_title(f"{how}, all wavelengths with equal weight", loc="left")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _draw_contrast(
    panel: Panel, facts: LensFacts, numbers: list[int], curves: tuple[Tensor, Mtf, Mtf]
) -> None:
    cycles, mtf, limit = curves
    for row, i in enumerate(numbers):
        color, label = field_color(i), f"{to_degrees(facts.lens.field_angles_rad[i]):.4g}°"
        panel.plot(cycles, mtf.tangential[row], color=color, label=f"{label} tangential")
        panel.plot(cycles, mtf.sagittal[row], "--", color=color, label=f"{label} sagittal")
    first, last = limit.tangential[0], limit.tangential[-1]
    panel.plot(cycles, first, color="black", linewidth=1.4, label="limit, first field")
    if len(numbers) > 1:
        panel.plot(cycles, last, color="#777777", label="limit, last field, tangential")


def trace_mtf(facts: LensFacts, numbers: list[int]) -> tuple[Tensor, Mtf, Mtf]:
    """Return frequencies in cycles/mm, the contrast of some lit fields and its diffraction limit.

    A field whose image was summed by waves has the contrast of that; of others it is that of the
    rays times the limit.
    """
    lens, waves, image = facts.lens, facts.wavelengths_um, facts.image
    assert image is not None
    slopes, definition = facts.slopes[numbers], facts.pupil.definition
    rim = trace_wavefront(lens, slopes, waves, rim_samples(), definition)
    try:
        cutoff = 2 * widest_aperture(rim) * UM_PER_MM / float(waves.min())
    except ContractError:
        cutoff = math.inf
    top = min(MAX_CYCLES_PER_MM, cutoff)
    cycles = torch.linspace(0, top, _FREQUENCIES, dtype=torch.float64)
    limit = diffraction_limit(rim, cycles)
    pupil = Pupil(definition=definition, sampling=_DENSE_SAMPLING)
    rays = geometric_mtf(spot_diagram(lens, slopes, waves, pupil), cycles).times(limit)
    tangential, sagittal = list(rays.tangential), list(rays.sagittal)
    for row, field in enumerate(numbers):
        image_here = image.images[field]
        if image_here is None:
            continue
        whole = torch.full((1, len(waves)), image_here.pitch_mm**-2, dtype=torch.float64)
        pitch_um = image_here.pitch_mm * UM_PER_MM
        contrast = mtf_of_psf(image_here.light_per_mm2[None], pitch_um, cycles, whole)
        tangential[row], sagittal[row] = contrast.tangential[0], contrast.sagittal[0]
    both = Mtf(tangential=torch.stack(tangential), sagittal=torch.stack(sagittal))
    return cycles, both, limit


@chart
def draw_field(facts: LensFacts) -> Figure:
    """Draw the three curves up to the largest field."""
    lens = facts.lens
    largest = max(lens.field_angles_rad)
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    for panel, title in zip((left, middle, right), _OF_FIELD, strict=True):
        panel.set_title(title)
    left.set_ylabel("field angle, degrees")
    if not largest:
        middle.set_xlabel("the file has no field off the axis")
        return figure
    # not the axis itself, where distortion is no number
    angles = torch.linspace(largest / 100, largest, _POINTS, dtype=torch.float64)
    degrees = torch.rad2deg(angles)
    foci = field_curvature(lens, field_slope(angles), facts.wavelengths_um, facts.pupil.definition)
    share = distortion(lens, field_slope(angles), facts.wavelengths_um, facts.pupil.definition)
    for j, wave in enumerate(lens.wavelengths_um):
        color, name = wave_color(wave), f"{wave:.4g} µm"
        left.plot(foci.tangential_mm[:, j], degrees, color=color, label=f"{name} T")
        left.plot(foci.sagittal_mm[:, j], degrees, color=color, linestyle="--", label=f"{name} S")
        middle.plot(100 * share[:, j], degrees, color=color, label=name)
    middle.set_ylim(left.get_ylim())
    for panel in (left, middle):
        panel.axvline(0, color="black", linewidth=0.8)
        panel.legend()
    _draw_light(right, facts, largest)
    return figure


def _draw_light(panel: Panel, facts: LensFacts, largest_rad: float) -> None:
    reference = torch.tensor([facts.lens.reference_wavelength_um], dtype=torch.float64)
    few = torch.linspace(0, largest_rad, _LIGHT_POINTS, dtype=torch.float64)
    try:
        light = relative_illumination_of(facts.lens, field_slope(few), reference)[:, 0]
    except ContractError:
        light = torch.full_like(few, math.nan)
    panel.plot(torch.rad2deg(few), light, color="#333333", label="lens")
    cos4 = torch.cos(few).clamp_min(0) ** 4
    panel.plot(torch.rad2deg(few), cos4, color="#999999", linestyle=":", label="cos$^4$")
    panel.set(
        ylim=(0, max(1.05, float(torch.nan_to_num(light).max()) * 1.05)),
        xlim=(0, to_degrees(largest_rad)),
        xlabel="field angle, degrees",
    )
    panel.legend()


@chart
def draw_colour(facts: LensFacts) -> Figure:
    """Draw the three charts."""
    lens, waves = facts.lens, facts.wavelengths_um
    figure = new_figure(9.5, 3.9)
    left, middle, right = figure.subplots(1, 3)
    zone = torch.linspace(0.02, 1, _POINTS, dtype=torch.float64)
    cross = longitudinal_mm(lens, zone, waves)
    angles = torch.linspace(0, max(lens.field_angles_rad), _POINTS, dtype=torch.float64)
    slopes, degrees = field_slope(angles), torch.rad2deg(angles)
    lateral_um = lateral_colour_mm(lens, slopes, waves, facts.pupil.definition) * UM_PER_MM
    for j, wave in enumerate(lens.wavelengths_um):
        color, label = wave_color(wave), f"{wave:.4g} µm"
        left.plot(cross[j], zone, color=color, label=label)
        right.plot(degrees, lateral_um[:, j], color=color, label=label)
    left.axvline(0, color="black", linewidth=0.8)
    left.set(
        title="axial rays cross the axis at, mm from the sensor",
        ylabel="height in the entrance pupil",
    )
    span = torch.linspace(float(waves.min()), float(waves.max()), _POINTS, dtype=torch.float64)
    middle.plot(span, axial_colour_mm(lens, span) * UM_PER_MM, color="#333333")
    middle.plot(waves, axial_colour_mm(lens, waves) * UM_PER_MM, "o", color="#333333")
    middle.axhline(0, color="black", linewidth=0.8)
    middle.set(title="axial colour: paraxial focus, µm", xlabel="wavelength, µm")
    right.set(title="lateral colour of the chief ray, µm", xlabel="field angle, degrees")
    left.legend()
    right.legend()
    return figure


@chart
def draw_seidel(facts: LensFacts) -> Figure:
    """Draw a group of bars per surface, and one for the sum, of a lens that has sums."""
    sums = facts.seidel
    assert sums is not None
    columns = [*sums.surfaces_mm.T, sums.axial_colour_mm, sums.lateral_colour_mm]
    count = len(sums.surfaces_mm)
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    width = 0.8 / len(columns)
    places = [*range(count), count + 0.5]  # the sum stands apart
    bars = zip(_SUMS.items(), columns, strict=True)
    for number, ((name, color), values) in enumerate(bars):
        heights = [*values.tolist(), float(values.sum())]
        shifted = [place + (number - (len(columns) - 1) / 2) * width for place in places]
        panel.bar(shifted, heights, width=width, color=color, label=name)
    panel.axhline(0, color="black", linewidth=0.8)
    panel.set_xticks(places, [*map(str, range(count)), "sum"])
    panel.grid(visible=False, axis="x")
    panel.set(xlabel="surface", ylabel="mm")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure

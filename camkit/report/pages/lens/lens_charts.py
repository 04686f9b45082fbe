"""The charts of a lens's curves: spots, MTF, over the field, over colour, third-order sums."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
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
from camkit.models_def.optics.analysis.sampling import Pupil, pupil_samples
from camkit.models_def.optics.analysis.spots import spot_diagram
from camkit.models_def.optics.analysis.wave_psf import (
    irradiance_per_mm2,
    pupil_for_reach,
    widest_aperture,
)
from camkit.models_def.optics.analysis.wavefront import trace_wavefront
from camkit.models_def.optics.render.illumination import relative_illumination_of
from camkit.report.figure import MARKS, Figure, Panel, chart, field_color, new_figure, wave_color
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

COLUMNS = 5
MAX_CYCLES_PER_MM: Final = 100.0
_FREQUENCIES: Final = 101
_RIM_SAMPLING: Final = "hexapolar:10"
_DENSE_SAMPLING: Final = "gauss:24x48"
_WINDOW_AIRY: Final = 6.0
_SAMPLES_PER_CUTOFF: Final = 3.0
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
        _draw_spot(panel, facts, i, reach_um)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6)
    return figure


def _draw_spot(panel: Panel, facts: LensFacts, field: int, reach_um: float) -> None:
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
    panel.set(
        title=f"{angle:.4g}°   {text}",
        xlim=(-reach_um, reach_um),
        ylim=(-reach_um, reach_um),
        aspect="equal",
        xlabel="µm",
    )


@chart
def draw_mtf(facts: LensFacts) -> Figure:
    """Draw contrast, by waves or by rays times the diffraction limit, as the lens needs."""
    cycles, regime, mtf, limit = trace_mtf(facts)
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    for i in facts.drawn_fields():
        color, label = field_color(i), f"{to_degrees(facts.lens.field_angles_rad[i]):.4g}°"
        panel.plot(cycles, mtf.tangential[i], color=color, label=f"{label} tangential")
        panel.plot(cycles, mtf.sagittal[i], "--", color=color, label=f"{label} sagittal")
    first, last = limit.tangential[0], limit.tangential[-1]
    panel.plot(cycles, first, color="black", linewidth=1.4, label="limit, first field")
    if len(facts.lens.field_angles_rad) > 1:
        panel.plot(cycles, last, color="#777777", label="limit, last field, tangential")
    panel.set(xlim=(0, float(cycles[-1])), ylim=(0, 1.02), xlabel="cycles/mm", ylabel="contrast")
    words = {"waves": "diffraction PSF", "rays": "rays times diffraction limit"}
    panel.set_title(f"{words[regime]}, all wavelengths with equal weight", loc="left")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def trace_mtf(facts: LensFacts) -> tuple[Tensor, str, Mtf, Mtf]:
    """Return frequencies in cycles/mm, the model used, the contrast and its diffraction limit."""
    lens, waves = facts.lens, facts.wavelengths_um
    definition = facts.pupil.definition
    rim = trace_wavefront(lens, facts.slopes, waves, pupil_samples(_RIM_SAMPLING), definition)
    try:
        cutoff = 2 * widest_aperture(rim) * UM_PER_MM / float(waves.min())
    except ContractError:
        cutoff = math.inf
    top = min(MAX_CYCLES_PER_MM, cutoff)
    cycles = torch.linspace(0, top, _FREQUENCIES, dtype=torch.float64)
    limit = diffraction_limit(rim, cycles)
    if facts.model.regime == "waves" and math.isfinite(cutoff):
        try:
            return cycles, "waves", _wave_mtf(facts, cycles, cutoff), limit
        except ContractError:
            pass  # too wide a blur at another field: rays times the limit serve all
    pupil = Pupil(definition=definition, sampling=_DENSE_SAMPLING)
    rays = geometric_mtf(spot_diagram(lens, facts.slopes, waves, pupil), cycles)
    return cycles, "rays", rays.times(limit), limit


def _wave_mtf(facts: LensFacts, cycles: Tensor, cutoff: float) -> Mtf:
    """Sum the diffraction PSF over a window of some Airy radii beyond the widest spot."""
    lens, waves = facts.lens, facts.wavelengths_um
    airy = float(facts.airy_mm.max())
    spread = float(torch.nan_to_num(facts.max_mm).max())
    half = spread + _WINDOW_AIRY * airy
    shortest = float(waves.min())
    aperture = cutoff * shortest / UM_PER_MM / 2
    samples = pupil_for_reach(math.sqrt(2) * half, shortest, aperture)
    side = 2 * math.ceil(half * cutoff * _SAMPLES_PER_CUTOFF / 2) + 1
    place = torch.linspace(-half, half, side, dtype=torch.float64)
    pitch_mm = float(place[1] - place[0])
    wavefront = trace_wavefront(lens, facts.slopes, waves, samples, facts.pupil.definition)
    light = irradiance_per_mm2(wavefront, place, place)
    whole = torch.full(light.shape[:2], pitch_mm**-2, dtype=torch.float64)
    return mtf_of_psf(light, pitch_mm * UM_PER_MM, cycles, whole)


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
    slopes = torch.tan(torch.linspace(0, max(lens.field_angles_rad), _POINTS, dtype=torch.float64))
    degrees = torch.rad2deg(torch.atan(slopes))
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

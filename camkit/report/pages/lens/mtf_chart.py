"""Contrast of every field against spatial frequency, with its diffraction limit."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
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
from camkit.report.figure import Figure, chart, field_color, new_figure
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

MAX_CYCLES_PER_MM: Final = 100.0
_FREQUENCIES: Final = 101
_RIM_SAMPLING: Final = "hexapolar:10"
_DENSE_SAMPLING: Final = "gauss:24x48"
_WINDOW_AIRY: Final = 6.0
_SAMPLES_PER_CUTOFF: Final = 3.0


@chart
def draw_mtf(facts: LensFacts) -> Figure:
    """Draw contrast, by waves or by rays times the diffraction limit, as the lens needs."""
    cycles, regime, found, limit = trace_mtf(facts)
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    for i in facts.drawn_fields():
        color, label = field_color(i), f"{to_degrees(facts.lens.field_angles_rad[i]):.4g}°"
        panel.plot(cycles, found.tangential[i], color=color, label=f"{label} tangential")
        panel.plot(cycles, found.sagittal[i], "--", color=color, label=f"{label} sagittal")
    first, last = limit.tangential[0], limit.tangential[-1]
    panel.plot(cycles, first, color="black", linewidth=1.4, label="limit, first field")
    if len(facts.lens.field_angles_rad) > 1:
        panel.plot(cycles, last, color="#777777", label="limit, last field, tangential")
    panel.set_xlim(0, float(cycles[-1]))
    panel.set_ylim(0, 1.02)
    panel.set_xlabel("cycles/mm")
    panel.set_ylabel("contrast")
    words = {"wave": "diffraction PSF", "geometric": "rays times diffraction limit"}
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
    if facts.model.regime == "wave" and math.isfinite(cutoff):
        try:
            return cycles, "wave", _wave_mtf(facts, cycles, cutoff), limit
        except ContractError:
            pass  # too wide a blur at another field: rays times the limit serve all
    pupil = Pupil(definition=definition, sampling=_DENSE_SAMPLING)
    rays = geometric_mtf(spot_diagram(lens, facts.slopes, waves, pupil), cycles)
    return cycles, "geometric", rays.times(limit), limit


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

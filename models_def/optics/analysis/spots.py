"""Spot diagrams: where the rays of a field land, about its centroid and about its chief ray.

Every ray counts by its share of the pupil's disc, not by the area of its beam, as the spot
diagrams of other programs do.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.field import field_slope
from camkit.models_def.optics.aiming.start import with_open_apertures
from camkit.models_def.optics.analysis.sampling import Pupil, pupil_samples, sample_weights
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import (
    PupilDefinition,
    PupilSamples,
    beam_radius_mm,
    pupil_centre,
    pupil_rays,
    real_stop_radius_mm,
)
from camkit.models_def.optics.spot import Spots, all_waves, rms_radius
from camkit.models_def.optics.trace import (
    Fate,
    Rays,
    SurfaceTensors,
    refract,
    surface_tensors,
    trace,
)

_EDGE_SLACK: Final = 1e-7
CONVERGENCE_SAMPLINGS: Final = (
    *("hexapolar:3", "hexapolar:6", "hexapolar:12", "hexapolar:24"),
    *("gauss:4x8", "gauss:8x16", "gauss:16x32", "fibonacci:2048", "fibonacci:8192"),
)


def field_slopes(lens: Lens) -> Tensor:
    """Return the slopes (field,) of the field angles of the file."""
    return field_slope(torch.tensor(lens.field_angles_rad, dtype=torch.float64))


def analysis_tensors(lens: Lens, wavelengths_um: Tensor) -> SurfaceTensors:
    """Return the tensors of a lens, rims wide enough for rays that rounding put beyond them."""
    tensors = surface_tensors(lens, wavelengths_um)
    return replace(tensors, semi_diameter_mm=tensors.semi_diameter_mm * (1 + _EDGE_SLACK))


@dataclass(frozen=True, slots=True, kw_only=True)
class Beams:
    """Rays of fields and wavelengths at the first vertex plane.

    Attributes:
        tensors: The lens at the wavelengths, (..., wavelength, 1).
        rays: (field, wavelength, rays).
        area_mm2: (field, wavelength, rays), of their beams there; 0 if not aimed.
    """

    tensors: SurfaceTensors
    rays: Rays
    area_mm2: Tensor


def launch_beams(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    samples: PupilSamples,
    definition: PupilDefinition,
    *,
    open_apertures: bool = False,
) -> Beams:
    """Start the rays of every field and wavelength.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        samples: Of the unit disc, (rays,).
        definition: Of the pupil; `stop` with the radius of the real marginal ray.
        open_apertures: Let rays pass beyond the rims.
    """
    tensors = analysis_tensors(lens, wavelengths_um[:, None])
    if open_apertures:
        tensors = with_open_apertures(tensors)
    stop_mm = real_stop_radius_mm(lens) if definition == "stop" else None
    slope = slopes[:, None, None].expand(-1, len(wavelengths_um), 1)
    rays, weight = pupil_rays(
        lens, tensors, samples, slope, definition=definition, stop_radius_mm=stop_mm
    )
    radius = beam_radius_mm(lens) if stop_mm is None else stop_mm
    share_mm2 = math.pi * radius**2 / len(samples.x)
    return Beams(tensors=tensors, rays=rays, area_mm2=weight * share_mm2)


def paraxial_pupil_misses(lens: Lens, slopes: Tensor) -> Tensor:
    """Return how far (field,) beside the stop's middle the middle of the paraxial pupil sends rays.

    At the reference wavelength, as a share of the stop's radius; inf where the ray is lost. From
    some tenths on, spots by the definition `paraxial` are not those of the lens.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
    """
    waves = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    beams = launch_beams(lens, slopes, waves, pupil_centre(), "paraxial", open_apertures=True)
    met = refract(
        beams.tensors, trace(beams.tensors, beams.rays, surfaces=range(lens.stop)), lens.stop
    )
    share = torch.hypot(met.x, met.y) / paraxial_data(lens).stop_semi_diameter_mm
    return torch.where(met.valid, share, math.inf)[:, 0, 0]


def launch_near_chief(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    samples: PupilSamples,
    definition: PupilDefinition,
) -> Beams:
    """Start chief rays, or rays close to them; arguments as of `launch_beams`.

    The chief ray passes the middle of the stop, or of the paraxial entrance pupil by that
    definition. Rims do not stop it: it is a reference even where the beam is vignetted.
    """
    # any radius does for the middle, so that of the stop need not be traced
    aimed: PupilDefinition = "paraxial" if definition == "paraxial" else "chief"
    return launch_beams(lens, slopes, wavelengths_um, samples, aimed, open_apertures=True)


def chief_landings(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, definition: PupilDefinition
) -> Tensor:
    """Return the heights (field, wavelength) in mm of chief rays on the sensor; NaN if lost."""
    beams = launch_near_chief(lens, slopes, wavelengths_um, pupil_centre(), definition)
    landings = trace(beams.tensors, beams.rays)
    return torch.where(landings.valid, landings.y, math.nan)[..., 0]


def spot_diagram(lens: Lens, slopes: Tensor, wavelengths_um: Tensor, pupil: Pupil) -> Spots:
    """Trace spots (field, wavelength, rays); lost rays have weight 0.

    `chief_y_mm` is the chief ray of the reference wavelength by the pupil's definition.

    Raises:
        ContractError: If the stop has no real radius (definition `stop`).
    """
    beams = launch_beams(lens, slopes, wavelengths_um, pupil.samples, pupil.definition)
    landings = trace(beams.tensors, beams.rays)
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    return Spots(
        x_mm=landings.x,
        y_mm=landings.y,
        weight=torch.where(landings.valid, sample_weights(pupil.samples), 0.0),
        chief_y_mm=chief_landings(lens, slopes, reference, pupil.definition)[:, 0],
        fate=landings.fate,
    )


def rms_about_centroid(spots: Spots) -> Tensor:
    """Return the RMS radius (field, wavelength) in mm about the centroid; NaN without rays."""
    return torch.where(spots.weight.sum(-1) > 0, rms_radius(spots), math.nan)


def rms_of_all_waves(spots: Spots) -> Tensor:
    """Return the RMS radius (field,) in mm of all wavelengths about their common centroid.

    Every wavelength has the same weight, however many of its rays are lost; NaN without rays.
    """
    return rms_about_centroid(all_waves(spots))[:, 0]


def rms_about_chief(spots: Spots) -> Tensor:
    """Return the RMS distance (field, wavelength) in mm from the chief ray; NaN without rays."""
    square = (spots.weight * _from_chief(spots) ** 2).sum(-1) / spots.weight.sum(-1)
    return torch.sqrt(square)


def max_from_chief(spots: Spots) -> Tensor:
    """Return the largest distance (field, wavelength) in mm from the chief ray; NaN without rays.

    The chief ray is that of the reference wavelength.
    """
    alive = spots.weight > 0
    largest = torch.where(alive, _from_chief(spots), -1.0).amax(-1)
    return torch.where(alive.any(-1), largest, math.nan)


def _from_chief(spots: Spots) -> Tensor:
    return torch.hypot(spots.x_mm, spots.y_mm - spots.chief_y_mm[:, None, None])


@dataclass(frozen=True, slots=True, kw_only=True)
class Convergence:
    """RMS radii of the reference wavelength about the centroid by sampling.

    Attributes:
        samplings: Names.
        rays: How many each has.
        rms_mm: (sampling, field); the last sampling is the finest.
    """

    samplings: tuple[str, ...]
    rays: tuple[int, ...]
    rms_mm: Tensor


def spot_convergence(lens: Lens, slopes: Tensor, definition: PupilDefinition) -> Convergence:
    """Trace the spots of the fields with coarse and fine samplings of the pupil."""
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    pupils = [pupil_samples(name) for name in CONVERGENCE_SAMPLINGS]
    counts = [len(samples.x) for samples in pupils]
    # all are aimed at once, which takes as long as one of them
    joint = PupilSamples(x=torch.cat([s.x for s in pupils]), y=torch.cat([s.y for s in pupils]))
    beams = launch_beams(lens, slopes, wave, joint, definition)
    landings = trace(beams.tensors, beams.rays)
    places = (torch.split(values, counts, dim=-1) for values in (landings.x, landings.y))
    fates = torch.split(landings.fate, counts, dim=-1)
    rms = [
        rms_about_centroid(
            Spots(
                x_mm=x,
                y_mm=y,
                weight=torch.where(fate == Fate.VALID, sample_weights(samples), 0.0),
                chief_y_mm=torch.zeros_like(slopes),
                fate=fate,
            )
        )[:, 0]
        for x, y, fate, samples in zip(*places, fates, pupils, strict=True)
    ]
    return Convergence(samplings=CONVERGENCE_SAMPLINGS, rays=tuple(counts), rms_mm=torch.stack(rms))

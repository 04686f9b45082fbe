"""The wave PSF of a lens on sensor pixels: what `psf.trace_psf` is for rays."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.pupil_fit import FIT_GRIDS, FitGrid, half_quadrature
from camkit.models_def.optics.analysis.spots import chief_landings, launch_beams
from camkit.models_def.optics.analysis.wave_kernels import (
    CoarsePupil,
    Waves,
    is_smooth,
    normalised,
    pixel_light,
    quadrature_for,
    rim_margins,
    summed_light,
)
from camkit.models_def.optics.analysis.wavefront import (
    chief_path_mm,
    path_lengths,
    sphere_radius_mm,
    to_sphere,
    trace_wavefront,
)
from camkit.models_def.optics.prescription import Lens, require_round
from camkit.models_def.optics.psf import TracedPsf
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.trace import Rays
from camkit.units import UM_PER_MM

_CHUNK_RAYS: Final = 200_000


def wave_psf(
    lens: Lens,
    slopes: Tensor,
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    mask: Tensor | None = None,
) -> TracedPsf:
    """Sum the PSFs of field slopes from waves, with the conventions of `psf.trace_psf`.

    Every ray is aimed at its point of the stop, whose radius is that of the paraxial marginal ray.
    Where the paths are no polynomials, or rays are lost beyond the rims, all rays are traced.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        mask: (field, wavelength), which of them; all by default. The others are 0.

    Raises:
        ContractError: If the side is even, a field gets no light, or its blur needs too many rays.
        UnsupportedError: If the lens is not round.
    """
    require_round(lens, "a PSF from half the pupil")
    if mask is None:
        mask = torch.ones(len(slopes), len(wavelengths_um), dtype=torch.bool)
    fixed, lit = with_fixed_stop(lens), mask.any(1)
    kernels = slopes.new_zeros(*mask.shape, size_px, size_px)
    if not bool(lit.any()):
        return normalised(kernels)
    most = FIT_GRIDS[0].rings * FIT_GRIDS[0].arms // 2 * len(wavelengths_um)
    fields = max(1, _CHUNK_RAYS // most)
    light = []
    for some, field_mask in zip(
        torch.split(slopes[lit], fields), torch.split(mask[lit], fields), strict=True
    ):
        coarse, smooth = coarse_pupil(fixed, some, wavelengths_um)
        if smooth:
            light.append(summed_light(coarse, size_px, pitch_um, field_mask))
        else:
            light.append(_traced_light(fixed, some, coarse, (size_px, pitch_um), field_mask))
    kernels[lit] = torch.cat(light)
    return normalised(kernels)


def _traced_light(
    lens: Lens, slopes: Tensor, coarse: CoarsePupil, window: tuple[int, float], mask: Tensor
) -> Tensor:
    """Return the light of `summed_light`, with all rays traced."""
    rows = [
        torch.stack(
            [
                pixel_light(traced_waves(lens, slope, coarse, (i, j), *window), *window)
                if bool(mask[i, j])
                else slopes.new_zeros(window[0], window[0])
                for j in range(len(coarse.wavelengths_um))
            ]
        )
        for i, slope in enumerate(slopes)
    ]
    return torch.stack(rows)


def coarse_pupil(lens: Lens, slopes: Tensor, wavelengths_um: Tensor) -> tuple[CoarsePupil, bool]:
    """Trace the coarsest pupil that holds the paths of all fields, or the finest.

    Args:
        lens: With a fixed stop.
        slopes: (field,).
        wavelengths_um: (wavelength,).

    Returns:
        The pupil, and whether it does hold them.
    """
    for grid in FIT_GRIDS:
        coarse, alive = _traced_pupil(lens, slopes, wavelengths_um, grid)
        smooth = alive and is_smooth(coarse)
        if smooth or not alive:
            break
    return coarse, smooth


def _traced_pupil(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, grid: FitGrid
) -> tuple[CoarsePupil, bool]:
    """Return the pupil on a grid, and whether every ray arrives."""
    samples = half_quadrature(grid.rings, grid.arms)
    assert samples.weight is not None
    reference = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    centre = chief_landings(lens, slopes, reference, "stop")[:, 0]
    beams = launch_beams(lens, slopes, wavelengths_um, samples, "stop", open_apertures=True)
    surface_rays: list[Rays] = []
    landings, path = path_lengths(
        beams.tensors, beams.rays, slopes[:, None, None], lens.object_distance_mm, surface_rays
    )
    sphere = to_sphere(
        landings, path, centre[:, None, None], sphere_radius_mm(lens), beams.tensors.index[-1]
    )
    middle = chief_path_mm(lens, slopes, wavelengths_um, centre, "stop")
    rims = torch.tensor([s.semi_diameter_mm for s in lens.surfaces], dtype=torch.float64)
    margins = rim_margins(surface_rays, rims)
    passes = sphere.valid & (margins < 0).all(0)
    coarse = CoarsePupil(
        grid=grid,
        l=sphere.l,
        m=sphere.m,
        opd_um=torch.nan_to_num((middle - sphere.path) * UM_PER_MM),
        area=beams.area_mm2 / (math.pi * samples.weight),
        margins=margins,
        miss_mm=torch.where(passes, sphere.miss_mm, 0.0),
        wavelengths_um=wavelengths_um,
    )
    return coarse, bool((sphere.valid & (beams.area_mm2 > 0)).all())


def traced_waves(
    lens: Lens,
    slope: Tensor,
    coarse: CoarsePupil,
    place: tuple[int, int],
    size_px: int,
    pitch_um: float,
) -> Waves:
    """Trace all rays of a field and wavelength, with none of them interpolated.

    Args:
        lens: With a fixed stop.
        slope: (), of the field.
        coarse: With that field; says how many rays the window needs.
        place: Numbers of field and wavelength in it.
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
    """
    wave_um = coarse.wavelengths_um[place[1]]
    samples = half_quadrature(*quadrature_for(coarse, *place, size_px, pitch_um))
    front = trace_wavefront(lens, slope[None], wave_um[None], samples, "stop")
    return Waves(
        l=front.l[0, 0],
        m=front.m[0, 0],
        opd_um=front.opd_um[0, 0],
        amplitude=front.amplitude[0, 0],
        flux=front.flux[0, 0],
        wavelength_um=float(wave_um),
    )

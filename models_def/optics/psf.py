"""Geometric point spread functions, splatted differentiably onto sensor pixels.

Geometric is right where the blur is wide against the Airy disc; `analysis.psf_model` says where it
is, `analysis.lens_waves` has the other PSF. Each ray is spread with a tent of one pixel to each
side. A tent is two boxes: one integrates the light over the area of the sensor pixel, the other
is the pixel of the sharp picture that the kernel is applied to. The gradient flows through the
tent weights to the ray positions.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.models_def.optics.prescription import Lens, require_round
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import Spots, slopes_for_heights, trace_spots
from camkit.units import UM_PER_MM, to_radians

DEFAULT_RAYS: Final = 8192
_CHUNK_RAYS: Final = 400_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TracedPsf:
    """Kernels and how much light they hold.

    Attributes:
        kernels: (field, wavelength, size, size), each sums to 1.
        energy_kept: (field, wavelength), share of the light that fell into the window.
    """

    kernels: Tensor
    energy_kept: Tensor


def splat(spots: Spots, size_px: int, pitch_um: float, *, whole_pupil: bool = False) -> TracedPsf:
    """Convert half-pupil spots (mirrored at x = 0) to kernels centred on the chief ray.

    Args:
        spots: Rays with x >= 0 in the pupil.
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        whole_pupil: Whether the rays are those of both halves, which nothing mirrors.

    Raises:
        ContractError: If the side is even, or no light falls into a kernel.
    """
    if size_px < 1 or size_px % 2 == 0:
        raise ContractError(f"kernel side must be odd; got {size_px}")
    scale, centre = UM_PER_MM / pitch_um, (size_px - 1) / 2
    column = spots.x_mm * scale + centre
    row = (spots.y_mm - spots.chief_y_mm[:, None, None]) * scale + centre
    light = spread_tents(row, column, spots.weight, size_px)
    if whole_pupil:
        return as_psf(light, spots.weight.sum(-1))
    return as_psf(light + light.flip(-1), 2 * spots.weight.sum(-1))


def as_psf(light: Tensor, whole: Tensor) -> TracedPsf:
    """Return kernels that sum to 1 of the light (..., size, size) that fell into windows.

    Args:
        light: In each pixel.
        whole: (...), all light of a kernel, in the window or beside it.

    Raises:
        ContractError: If no light falls into a kernel.
    """
    inside = light.sum((-2, -1))
    if bool((inside <= 0).any()):
        raise ContractError("no light reaches a kernel; check stop, semi-diameters and focus")
    return TracedPsf(kernels=light / inside[..., None, None], energy_kept=inside / whole)


def spread_tents(row: Tensor, column: Tensor, weight: Tensor, size_px: int) -> Tensor:
    """Return the light (..., size, size) of rays (..., ray), each spread over four pixels.

    Args:
        row: Where rays land, in pixels of the window; what falls beside it is lost.
        column: Likewise.
        weight: Of the rays.
        size_px: Side of the window.
    """
    flat = torch.zeros(*row.shape[:-1], size_px * size_px, dtype=row.dtype)
    for corner in range(4):
        place, share = _tent(row, column, divmod(corner, 2), size_px)
        flat = flat.scatter_add(-1, place, share * weight)
    return flat.reshape(*row.shape[:-1], size_px, size_px)


def _tent(
    row: Tensor, column: Tensor, offset: tuple[int, int], size_px: int
) -> tuple[Tensor, Tensor]:
    """Return flat places and weights of one of the four pixels around each ray."""
    top, left = torch.floor(row.detach()), torch.floor(column.detach())
    row_share, column_share = row - top, column - left
    weight = (row_share if offset[0] else 1 - row_share) * (
        column_share if offset[1] else 1 - column_share
    )
    y, x = top + offset[0], left + offset[1]
    inside = (y >= 0) & (y < size_px) & (x >= 0) & (x < size_px)
    place = torch.where(inside, y * size_px + x, 0.0).to(torch.int64)
    return place, torch.where(inside, weight, 0.0)


def trace_psf(
    lens: Lens,
    heights_mm: Tensor,
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    rays: int = DEFAULT_RAYS,
) -> TracedPsf:
    """Trace the PSF at sensor heights and wavelengths, and its share of the light.

    Args:
        lens: The prescription.
        heights_mm: (field,), distance on the sensor of the reference chief ray from the axis;
            the field angles are solved for it.
        wavelengths_um: (wavelength,).
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        rays: In half the pupil; the other half is its mirror image.

    Returns:
        float64 kernels as they fall on the sensor, the centre pixel on the chief ray of the
        reference wavelength, rows increasing away from the axis (a point at +y).

    Raises:
        UnsupportedError: If the lens is not round; see `asymmetric.place_psf`.
    """
    require_round(lens, "a PSF from half the pupil")
    samples = half_disc(rays)
    slopes = slopes_for_heights(lens, heights_mm)
    fields = max(1, _CHUNK_RAYS // (rays * len(wavelengths_um)))
    parts = [
        splat(trace_spots(lens, some, wavelengths_um, samples), size_px, pitch_um)
        for some in torch.split(slopes, fields)
    ]
    return TracedPsf(
        kernels=torch.cat([p.kernels for p in parts]),
        energy_kept=torch.cat([p.energy_kept for p in parts]),
    )


def with_object_distance(lens: Lens, distance_mm: float) -> Lens:
    """Return the lens looking at another object distance, the sensor unmoved."""
    fields = lens.field_angles_rad
    if math.isfinite(distance_mm):  # no near object lies beside the lens
        fields = tuple(angle for angle in fields if angle <= to_radians(TANGENT_DEG)) or (0.0,)
    return replace(lens, object_distance_mm=distance_mm, field_angles_rad=fields)


def energy_diameter(spots: Spots, share: float = 0.95) -> Tensor:
    """Return the diameter (field,) in mm about the centroid that holds a share of the light.

    All wavelengths together, with equal weight.
    """
    fields = spots.x_mm.shape[0]
    weight = (spots.weight / spots.weight.sum(-1, keepdim=True)).reshape(fields, -1)
    weight = weight / weight.sum(-1, keepdim=True)
    x, y = spots.x_mm.reshape(fields, -1), spots.y_mm.reshape(fields, -1)
    # the mirrored half puts the centroid on x = 0
    radius = torch.hypot(x, y - (weight * y).sum(-1, keepdim=True))
    radius, order = radius.sort(-1)
    energy = weight.gather(-1, order).cumsum(-1)
    first = (energy >= share).to(torch.int8).argmax(-1, keepdim=True)
    return 2 * radius.gather(-1, first)[:, 0]

"""Kernels at places of the sensor, of a lens that is not round."""

from collections.abc import Sequence

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.asymmetric.places import fields_of_places
from camkit.models_def.optics.asymmetric.turning import turned_back, turned_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import DEFAULT_RAYS, TracedPsf, as_psf, spread_tents
from camkit.models_def.optics.pupil import both_halves, half_disc
from camkit.models_def.optics.spot import trace_spots
from camkit.units import UM_PER_MM


def trace_place_psf(
    lens: Lens,
    places_mm: Sequence[tuple[float, float]],
    wavelengths_um: Tensor,
    size_px: int,
    pitch_um: float,
    *,
    rays: int = DEFAULT_RAYS,
) -> TracedPsf:
    """Trace the PSF at places of the sensor and wavelengths, and its share of the light.

    Args:
        lens: The prescription.
        places_mm: x and y of each, where the chief ray of the reference wavelength lands.
        wavelengths_um: (wavelength,).
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        rays: In half the pupil; the other half has as many.

    Returns:
        float64 kernels (place, wavelength, size, size) as they fall on the sensor, the centre
        pixel on the place.

    Raises:
        ContractError: If the side is even, a place cannot be reached, or no light arrives there.
    """
    if size_px < 1 or size_px % 2 == 0:
        raise ContractError(f"kernel side must be odd; got {size_px}")
    samples, scale, centre = both_halves(half_disc(rays)), UM_PER_MM / pitch_um, (size_px - 1) / 2
    kernels, energy = [], []
    fields = fields_of_places(lens, tuple(places_mm))
    for (x_mm, y_mm), field in zip(places_mm, fields, strict=True):
        turned = turned_lens(lens, field.azimuth_rad)
        slope = torch.tensor([field.slope], dtype=torch.float64)
        spots = trace_spots(turned, slope, wavelengths_um, samples)
        x, y = turned_back(spots.x_mm[0], spots.y_mm[0], field.azimuth_rad)
        column, row = (x - x_mm) * scale + centre, (y - y_mm) * scale + centre
        kernels.append(spread_tents(row, column, spots.weight[0], size_px))
        energy.append(spots.weight[0].sum(-1))
    return as_psf(torch.stack(kernels), torch.stack(energy))

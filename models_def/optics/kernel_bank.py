"""Kernels per colour for training: the nominal lens and fabricated copies of it."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.optics.analysis.model_psf import model_psf
from camkit.models_def.optics.analysis.psf_model import PsfRegime
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, with_focus_shift
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors, perturb

USUAL_EFL_MM: Final = 40.0
"""Focal length from which errors of length grow no more."""
GAUSS_FWHM: Final = 2 * math.sqrt(2 * math.log(2))


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelResponse:
    """The share of every wavelength in a colour's light (for a flat spectrum).

    Attributes:
        wavelengths_um: (wavelength,), increasing.
        response: (c, wavelength), a row for each channel, each sums to 1.
        source: Where it comes from.
    """

    wavelengths_um: NDArray[np.float64]
    response: NDArray[np.float64]
    source: str

    def __post_init__(self) -> None:
        if self.response.ndim != 2 or self.response.shape[1] != self.wavelengths_um.size:
            raise ContractError(
                f"response must be (c, {self.wavelengths_um.size}); got {self.response.shape}"
            )
        if (self.response < 0).any() or np.abs(self.response.sum(1) - 1).max() > 1e-6:
            raise ContractError("each channel's response must be >= 0 and sum to 1")


def gaussian_response(
    wavelengths_um: NDArray[np.float64],
    *,
    centres_um: tuple[float, float, float] = (0.600, 0.540, 0.460),
    fwhm_um: float = 0.090,
) -> ChannelResponse:
    """Return Gaussian colour channels on a wavelength grid: camkit's own model camera.

    Args:
        wavelengths_um: (wavelength,), in um.
        centres_um: Of R, G and B.
        fwhm_um: Full width at half maximum of each.
    """
    sigma = fwhm_um / GAUSS_FWHM
    offset_um = wavelengths_um[None] - np.array(centres_um)[:, None]
    response = np.exp(-0.5 * (offset_um / sigma) ** 2)
    return ChannelResponse(
        wavelengths_um=wavelengths_um,
        response=response / response.sum(1, keepdims=True),
        source=f"model: Gaussians at {centres_um} um, FWHM {fwhm_um} um",
    )


def wavelength_grid(count: int, low_um: float = 0.42, high_um: float = 0.68) -> NDArray[np.float64]:
    """Return evenly spaced wavelengths (count,) in um."""
    return np.linspace(low_um, high_um, count)


def usual_errors(lens: Lens) -> FabricationErrors:
    """Return the tolerances of a lens: lengths are those of 40 mm, of a shorter lens in proportion.

    So a lens and its enlargement have copies whose PSFs are enlargements of each other.
    """
    share = min(1.0, abs(paraxial_data(lens).efl_mm) / USUAL_EFL_MM)
    whole = FabricationErrors()
    return replace(whole, thickness_mm=share * whole.thickness_mm, focus_mm=share * whole.focus_mm)


def fabricated_copies(
    lens: Lens, count: int, seed: int, errors: FabricationErrors | None = None
) -> tuple[Lens, ...]:
    """Return the nominal lens and `count` - 1 fabricated copies, not focused afresh.

    Args:
        lens: Nominal.
        count: At least 1.
        seed: Copy i is drawn from (seed, i), whatever the count.
        errors: The usual ones by default.
    """
    nominal = with_fixed_stop(lens)
    widths = errors or usual_errors(nominal)
    draws = (np.random.default_rng((seed, i)) for i in range(1, count))
    return (nominal, *(perturb(nominal, widths, rng) for rng in draws))


def focused_copies(
    lens: Lens, count: int, seed: int, errors: FabricationErrors | None = None
) -> tuple[Lens, ...]:
    """Return the copies of `fabricated_copies`, each one focused at assembly.

    Errors of radius and index move the focus by some 0.1 mm. A camera is focused when it is
    built: the sensor keeps its nominal distance from the copy's own paraxial focus, but for the
    focus error.
    """
    nominal, *copies = fabricated_copies(lens, count, seed, errors)
    nominal_bfl_mm = paraxial_data(nominal).bfl_mm
    shifts_mm = [paraxial_data(copy).bfl_mm - nominal_bfl_mm for copy in copies]
    focused = (with_focus_shift(c, mm) for c, mm in zip(copies, shifts_mm, strict=True))
    return (nominal, *focused)


def colour_kernels(
    lens: Lens,
    response: ChannelResponse,
    heights_mm: NDArray[np.float64],
    *,
    size_px: int,
    pitch_um: float,
    rays: int,
    regime: PsfRegime = "rays",
) -> tuple[FloatArray, float]:
    """Return kernels (field, c, size, size) float32 and the least energy kept of a colour."""
    with torch.no_grad():
        traced = model_psf(
            lens,
            torch.from_numpy(heights_mm),
            torch.from_numpy(response.wavelengths_um),
            size_px,
            pitch_um,
            regime=regime,
            rays=rays,
        )
        # light that fell outside counts: a wavelength weighs what it puts into the window
        share = torch.from_numpy(response.response)[None] * traced.energy_kept[:, None]
        energy = share.sum(-1)
        kernels = torch.einsum("fcw,fwij->fcij", share / energy[..., None], traced.kernels)
    return kernels.to(torch.float32).numpy(), float(energy.min())

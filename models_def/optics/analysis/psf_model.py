"""The PSF model of a lens: rays where the blur is wide against the Airy disc, waves where not.

One rule for `freeze`, `train`, `make`, `design`, maps of PSFs and the pages of lenses: a lens takes
waves if the RMS spot of a colour, about its centroid and with all wavelengths of the colour, has a
radius of less than `WAVE_BELOW` Airy radii at a field.
"""

from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import field_angle
from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import rms_about_centroid, spot_diagram
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.spot import Spots, tangents_for_heights
from camkit.units import UM_PER_MM

PsfRegime = Literal["rays", "waves"]
PSF_REGIMES: Final[tuple[PsfRegime, ...]] = get_args(PsfRegime)

WAVE_BELOW: Final = 7.0
"""RMS blur over Airy radius from which the MTF by rays is right to 0.05; docs/results/lens.md."""
FIELDS: Final = 7
_BLUR_SAMPLING: Final = "gauss:6x16"
_LEAST_RESPONSE: Final = 1e-3
_UNROUND: Final = "rays: this lens is not round, and waves are summed for round ones alone"


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfModel:
    """The PSF model that a lens needs, and the reason.

    Attributes:
        regime: The cheaper one that is right for every field and colour.
        blur_mm: (field, colour), RMS radius of the geometric spot; NaN without rays.
        airy_mm: (colour,), radius of the Airy disc on the axis at the colour's mean wavelength.
        reason: One sentence with the numbers that decide.
    """

    regime: PsfRegime
    blur_mm: Tensor
    airy_mm: Tensor
    reason: str

    @property
    def ratio(self) -> Tensor:
        """Blur over Airy radius (field, colour); inf without rays."""
        return torch.nan_to_num(self.blur_mm / self.airy_mm, nan=torch.inf)


def psf_model(
    lens: Lens, slopes: Tensor, wavelengths_um: Tensor, shares: Tensor | None = None
) -> PsfModel:
    """Return the PSF model that a lens needs.

    Args:
        lens: The prescription.
        slopes: (field,), tan of the field angles.
        wavelengths_um: (wavelength,).
        shares: (colour, wavelength), of each wavelength in the light of a colour; each wavelength
            is a colour by default.
    """
    shares = torch.eye(len(wavelengths_um), dtype=torch.float64) if shares is None else shares
    means_um = ((shares @ wavelengths_um) / shares.sum(1)).tolist()
    airy = torch.tensor([airy_radius_mm(lens, um) for um in means_um], dtype=torch.float64)
    pupil = Pupil(definition="stop", sampling=_BLUR_SAMPLING)
    spots = spot_diagram(with_fixed_stop(lens), slopes, wavelengths_um, pupil)
    blur = torch.cat([rms_about_centroid(_of_colour(spots, share)) for share in shares], dim=1)
    model = PsfModel(regime="rays", blur_mm=blur, airy_mm=airy, reason="")
    ratio = model.ratio
    if any(surface.grooves is not None for surface in lens.surfaces):
        reason = "rays: the light of grooves is no smooth wave"
        return replace(model, reason=reason)
    if not lens.is_round:
        return replace(model, reason=_UNROUND)
    if not bool(torch.isfinite(ratio).any()):
        reason = "rays: no ray arrives at any field, so there is nothing to compare"
        return replace(model, reason=reason)
    field, colour = divmod(int(ratio.argmin()), len(means_um))
    regime: PsfRegime = "waves" if float(ratio.min()) < WAVE_BELOW else "rays"
    angle_deg = float(torch.rad2deg(field_angle(slopes[field])))
    side = "less" if regime == "waves" else "no less"
    reason = (
        f"{regime}: the sharpest spot ({angle_deg:.3g} degrees, {means_um[colour]:.3g} um) has "
        f"an RMS radius of {float(blur[field, colour]) * UM_PER_MM:.2f} um, "
        f"{float(ratio[field, colour]):.2g} times the Airy radius of "
        f"{float(airy[colour]) * UM_PER_MM:.2f} um, {side} than {WAVE_BELOW:g} times"
    )
    return replace(model, regime=regime, reason=reason)


def sensor_model(
    lens: Lens,
    corner_mm: float,
    wavelengths_um: NDArray[np.float64],
    response: NDArray[np.float64],
) -> PsfModel:
    """Return the PSF model of a lens before a sensor, at `FIELDS` heights up to its corner.

    Args:
        lens: At the object distance that the camera is made for.
        corner_mm: Distance of the sensor's corner from the axis.
        wavelengths_um: (wavelength,).
        response: (c, wavelength), of the colours.

    Raises:
        ContractError: If no field reaches the corner.
    """
    # wavelengths that no colour sees may not even pass the glass
    is_visible = response.max(0) > _LEAST_RESPONSE * response.max()
    shares = torch.from_numpy(response[:, is_visible])
    shares = shares / shares.sum(1, keepdim=True)
    heights = torch.linspace(0, corner_mm, FIELDS, dtype=torch.float64)
    slopes = tangents_for_heights(lens, heights, "a PSF over the sensor")
    return psf_model(lens, slopes, torch.from_numpy(wavelengths_um[is_visible]), shares)


def checked_regime(value: str, name: str = "") -> PsfRegime | None:
    """Return the PSF model of a name; None for the empty one, which leaves the choice to the rule.

    Args:
        value: The name.
        name: Of the key that says so, for the message; that of the option by default.

    Raises:
        ContractError: If there is no such model.
    """
    if value and value not in PSF_REGIMES:
        raise ContractError(
            f"{name or option_text('psf_model')} is one of {', '.join(PSF_REGIMES)}; got {value!r}"
        )
    return next((regime for regime in PSF_REGIMES if regime == value), None)


def _of_colour(spots: Spots, share: Tensor) -> Spots:
    """Return the spots of a colour's light, (field, 1, wavelength * rays)."""
    total = spots.weight.sum(-1, keepdim=True).clamp_min(1e-300)
    return replace(
        spots,
        x_mm=spots.x_mm.flatten(1)[:, None],
        y_mm=spots.y_mm.flatten(1)[:, None],
        weight=(spots.weight / total * share[:, None]).flatten(1)[:, None],
        fate=spots.fate.flatten(1)[:, None],
    )

"""The image of a point over the field: Strehl ratios, encircled energy, by waves or by rays."""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.point_image import (
    PointImage,
    encircled_energy,
    encircled_rays,
    radius_of_share,
    trace_point_image,
)
from camkit.models_def.optics.analysis.psf_model import PsfModel
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import field_slopes, max_from_chief
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.spot import Spots

SHARES: Final = (0.5, 0.8, 0.9)
_RADII: Final = 101
_WIDER: Final = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LensImage:
    """The images of the fields of a lens.

    Attributes:
        images: By diffraction, of each field; None where there is no light or rays describe it.
        reasons: Why a field has no diffraction image; empty where it has one.
        radii_mm: (field, radius), of circles about the centroid.
        encircled: (field, radius), share of the light in them, all wavelengths equal; NaN where
            it is not known.
        strehl: (field, wavelength); NaN without a diffraction image.
    """

    images: tuple[PointImage | None, ...]
    reasons: tuple[str, ...]
    radii_mm: Tensor
    encircled: Tensor
    strehl: Tensor

    def radius_mm(self, field: int, share: float) -> float:
        """Return the radius that holds a share of the light of a field; NaN if not known."""
        return radius_of_share(self.radii_mm[field], self.encircled[field], share)


def image_of(lens: Lens, pupil: Pupil, spots: Spots, model: PsfModel) -> LensImage:
    """Compute the images of all fields, each by waves where they matter and can be summed.

    Args:
        lens: The prescription.
        pupil: Its definition is that of the waves too.
        spots: Rays on the sensor.
        model: Says whether the lens needs waves.
    """
    slopes = field_slopes(lens)
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    reach = max_from_chief(spots)
    lit = torch.isfinite(reach).all(-1)
    images: list[PointImage | None] = []
    reasons, radii, shares = [], [], []
    strehl = torch.full((len(slopes), len(waves)), math.nan, dtype=torch.float64)
    for i in range(len(slopes)):
        image, why = None, "" if lit[i] else "no light arrives at every wavelength"
        spread = float(torch.nan_to_num(reach[i]).max())
        if lit[i] and model.regime != "waves":
            why = model.reason
        elif lit[i]:
            try:
                image = trace_point_image(
                    lens, slopes[i : i + 1], waves, _one_field(spots, i), pupil.definition
                )
            except ContractError as error:
                why = str(error)
        wide = _WIDER * spread if image is None else float(image.y_mm[-1] - image.y_mm[0]) / 2
        radius = torch.linspace(0, wide, _RADII, dtype=torch.float64)
        if image is not None:
            strehl[i] = image.strehl
            shares.append(encircled_energy(image, radius))
        else:
            shares.append(encircled_rays(spots, i, radius))
        images.append(image)
        reasons.append(why)
        radii.append(radius)
    return LensImage(
        images=tuple(images),
        reasons=tuple(reasons),
        radii_mm=torch.stack(radii),
        encircled=torch.stack(shares),
        strehl=strehl,
    )


def _one_field(spots: Spots, field: int) -> Spots:
    here = slice(field, field + 1)
    return Spots(
        x_mm=spots.x_mm[here],
        y_mm=spots.y_mm[here],
        weight=spots.weight[here],
        chief_y_mm=spots.chief_y_mm[here],
        fate=spots.fate[here],
    )

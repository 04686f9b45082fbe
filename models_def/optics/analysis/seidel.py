"""Third-order (Seidel) and first-order chromatic sums, surface by surface.

Sign and unit of `seidel_mm`: S = 2 |n'u'| x transverse third-order aberration, in mm, so that a
negative S_I is undercorrected spherical aberration and a negative S_V barrel distortion. Welford's
wavefront sums are the negatives: W040 = -S_I / 8 at the edge of the pupil.
"""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import STEEPEST, field_slope
from camkit.models_def.optics.analysis.first_order import ParaxialRays, paraxial_rays
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.models_def.optics.paraxial import vertex_curvature
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.trace import SurfaceTensors

SEIDEL_NAMES: Final = ("S_I", "S_II", "S_III", "S_IV", "S_V")


@dataclass(frozen=True, slots=True, kw_only=True)
class Seidel:
    """Contributions of the surfaces; the sums over them are those of the lens.

    Attributes:
        surfaces_mm: (surface, 5): S_I spherical, S_II coma, S_III astigmatism, S_IV field
            curvature (Petzval), S_V distortion.
        axial_colour_mm: (surface,), C_L between the shortest and the longest wavelength.
        lateral_colour_mm: (surface,), C_T between them.
        petzval_per_mm: Petzval curvature of the image.
        image_slope: Slope u' of the marginal ray in the image.
    """

    surfaces_mm: Tensor
    axial_colour_mm: Tensor
    lateral_colour_mm: Tensor
    petzval_per_mm: Tensor
    image_slope: Tensor

    @property
    def sums_mm(self) -> Tensor:
        """Sums S_I..S_V of the lens, (5,)."""
        return self.surfaces_mm.sum(0)

    def transverse_mm(self) -> dict[str, float]:
        """Return the transverse aberrations as CODE V lists them.

        SA spherical, TCO tangential coma, TAS and SAS tangential and sagittal astigmatism, PTB
        Petzval blur, DST distortion, AX and LAT axial and lateral colour; mm. PTZ is the Petzval
        curvature in 1/mm.
        """
        one, two, three, four, five = (self.sums_mm / (-2 * self.image_slope)).tolist()
        return {
            "SA": one,
            "TCO": 3 * two,
            "TAS": 3 * three + four,
            "SAS": three + four,
            "PTB": four,
            "DST": five,
            "AX": float(self.axial_colour_mm.sum() / -self.image_slope),
            "LAT": float(self.lateral_colour_mm.sum() / -self.image_slope),
            "PTZ": float(self.petzval_per_mm),
        }


def seidel_sums(lens: Lens) -> Seidel:
    """Return the sums at the reference wavelength, for the largest field of the file.

    Raises:
        ContractError: If the entrance pupil is at infinity, a surface has odd terms, which have
            no third order, or a phase, or a field lies beyond 89.5 degrees.
    """
    for i, surface in enumerate(lens.surfaces):
        if any(surface.odd_asphere) or surface.phase is not None:
            raise ContractError(f"not computed: surface {i} has odd aspheric terms or a phase")
    widest = torch.tensor(max(lens.field_angles_rad), dtype=torch.float64)
    slope = float(field_slope(widest))
    if slope > STEEPEST:
        raise ContractError(f"not computed: they belong to fields below {TANGENT_DEG} degrees")
    rays = paraxial_rays(lens, slope)
    waves = (min(lens.wavelengths_um), max(lens.wavelengths_um))
    short, long = (paraxial_rays(lens, slope, wave).tensors.index for wave in waves)
    return seidel_of_rays(rays, short - long)


def seidel_of_rays(rays: ParaxialRays, dispersion: Tensor) -> Seidel:
    """Return the sums of traced paraxial rays, differentiable.

    Args:
        rays: Marginal and chief ray; the image is in air.
        dispersion: (surface + 1,), index of the shortest less that of the longest wavelength.

    References: Welford, Aberrations of Optical Systems (1986), chapters 8 and 10; the form of
        S_V there that does not divide by the marginal ray's angle of incidence.
    """
    tensors, h = rays.tensors, rays.invariant_mm
    c, n, y, ybar = (
        vertex_curvature(tensors),
        tensors.index,
        rays.marginal.height_mm,
        rays.chief.height_mm,
    )
    u, ubar = rays.marginal.slope, rays.chief.slope
    a, abar = n[:-1] * (u[:-1] + y * c), n[:-1] * (ubar[:-1] + ybar * c)
    bend = y * (u / n).diff()
    power = c * (1 / n).diff()
    spread = y * (dispersion / n).diff()
    five = -(abar**3) * y * (1 / n**2).diff() + abar * power * ybar * (2 * abar * y - a * ybar)
    spheres = torch.stack(
        [-(a**2) * bend, -a * abar * bend, -(abar**2) * bend, -(h**2) * power, five], dim=1
    )
    fourth = 8 * _departure(tensors) * n.diff()
    aspheres = torch.stack(
        [
            fourth * y**4,
            fourth * y**3 * ybar,
            fourth * y**2 * ybar**2,
            torch.zeros_like(y),
            fourth * y * ybar**3,
        ],
        dim=1,
    )
    return Seidel(
        surfaces_mm=-(spheres + aspheres),
        axial_colour_mm=-a * spread,
        lateral_colour_mm=-abar * spread,
        petzval_per_mm=power.sum(),
        image_slope=u[-1],
    )


def _departure(tensors: SurfaceTensors) -> Tensor:
    """Return the r^4 coefficient (surface,) beyond that of the sphere with the vertex's curvature.

    The r^2 term changes the vertex curvature, and so the sphere to compare with.
    """
    c, k = tensors.curvature_per_mm, tensors.conic
    total = (1 + k) * c**3 / 8
    if tensors.even_asphere.shape[1] > 1:
        total = total + _fourth(tensors)
    return total - vertex_curvature(tensors) ** 3 / 8


def _fourth(tensors: SurfaceTensors) -> Tensor:
    """Return the r^4 coefficient (surface,) of the polynomial parts."""
    rows = []
    for i, series in enumerate(tensors.series or [None] * len(tensors.aspheric)):
        first, second = tensors.even_asphere[i, :2]
        if series is not None:
            second = second / series.radius_mm**4
        if series is not None and series.over_root:
            opening = (1 + tensors.conic[i]) * tensors.curvature_per_mm[i] ** 2
            second = second + first / series.radius_mm**2 * opening / 2
        rows.append(second)
    return torch.stack(rows)

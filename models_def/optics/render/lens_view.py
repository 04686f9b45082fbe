"""The lens as the renderers see it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors


@dataclass(frozen=True, slots=True, kw_only=True)
class Optics:
    """A lens before a plane.

    Attributes:
        tensors: Gives the lens at wavelengths in um of any shape; no dimension but those of the
            index broadcasts against rays. Gradients flow through it.
        stop: Index of the stop surface.
        stop_radius_mm: Radius of the stop. It limits the rays, whatever the file says of the
            surface's semi-diameter (unless that is smaller), and does not move with the lens.
        object_distance_mm: From the first vertex, finite.
        reference_wavelength_um: Of the light on the axis that counts as 1.
    """

    tensors: Callable[[Tensor], SurfaceTensors]
    stop: int
    stop_radius_mm: float
    object_distance_mm: float
    reference_wavelength_um: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.object_distance_mm) and self.object_distance_mm > 0):
            raise ContractError(
                f"a texture hangs at a finite distance > 0; got {self.object_distance_mm} mm: set "
                "object_distance_mm of the lens (with_object_distance)"
            )
        if not self.stop_radius_mm > 0:
            raise ContractError(f"stop_radius_mm must be > 0; got {self.stop_radius_mm}")

    def stopped(self, wavelengths_um: Tensor) -> SurfaceTensors:
        """Return the tensors with the stop's rim in place."""
        tensors = self.tensors(wavelengths_um)
        rim = tensors.semi_diameter_mm.detach().clone()
        rim[self.stop] = rim[self.stop].clamp(max=self.stop_radius_mm)
        return replace(tensors, semi_diameter_mm=rim)


def lens_optics(lens: Lens) -> Optics:
    """Return the optics of a prescription, without gradient.

    Raises:
        ContractError: If its object is at infinity.
    """
    return Optics(
        tensors=partial(surface_tensors, lens),
        stop=lens.stop,
        stop_radius_mm=paraxial_data(lens).stop_semi_diameter_mm,
        object_distance_mm=lens.object_distance_mm,
        reference_wavelength_um=lens.reference_wavelength_um,
    )

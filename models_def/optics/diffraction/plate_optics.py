"""A plate before its lens as freezing sees it: computed wherever it is asked for.

The thin lens of the bench has no aberrations of its own, so kernels are the same all over the
field, and colours differ by diffraction and by the glass of the plate alone. A kernel is the light
of a point in the middle of a pixel, summed over the pixels of the sensor.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate import Plate
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.freezable_optics import FieldLayout, FloatGrid, uniform_layout
from camkit.models_def.optics.psf import TracedPsf
from camkit.radial import RadialDistortion
from camkit.units import MM_PER_M

REFERENCE_UM: Final = 0.55
"""The wavelength to take where there is one alone: a file of a plate names none."""


def plate_kernels(
    plate: Plate,
    *,
    depths_m: Sequence[float],
    wavelengths_um: Sequence[float],
    side_px: int,
    pitch_um: float,
    bare: bool = False,
) -> NDArray[np.float32]:
    """Return the light of a point through a plate, per light that its aperture lets through.

    What lies outside the window is missing: 1 - kernels.sum((-2, -1)) is its share.

    Args:
        plate: As it is made, etching included.
        depths_m: Distances of the point; inf is allowed. The sensor stays.
        wavelengths_um: Of its light.
        side_px: Odd side of the window, whose middle pixel lies on the axis.
        pitch_um: Of the sensor's pixels.
        bare: Of the same lens and aperture with a flat plate (the Dirac of comparisons).

    Returns:
        (depth, wavelength, side, side), shares of the light of a point, as it falls on the sensor.

    Raises:
        ContractError: If the plate's cells are too wide for the window, or a wavelength lies
            outside the range of its glass.
    """
    grid = PixelGrid(side_px=side_px, pitch_um=pitch_um)
    stacks = [
        _stack(plate, grid, MM_PER_M * depth_m, tuple(wavelengths_um), bare=bare)
        for depth_m in depths_m
    ]
    return torch.stack(stacks).to(torch.float32).numpy()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateOptics:
    """A plate before a thin lens; fulfils `camkit.models_def.optics.freezable_optics.Optics`.

    Attributes:
        plate: The plate and its bench.
    """

    plate: Plate

    @property
    def name(self) -> str:
        """Name of the plate."""
        return self.plate.name

    @property
    def facts(self) -> Mapping[str, float]:
        """Focal length, if it has a lens, and width of the aperture."""
        bench = self.plate.bench
        lens = {} if math.isinf(bench.focal_length_mm) else {"efl_mm": bench.focal_length_mm}
        return {**lens, "diameter_mm": bench.diameter_mm}

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """The distance that is sharp without the plate."""
        return (self.plate.bench.focus_mm,)

    @property
    def focus_mm(self) -> float:
        """The distance that is sharp without the plate."""
        return self.plate.bench.focus_mm

    @property
    def reference_wavelength_um(self) -> float:
        """The middle of the visible."""
        return REFERENCE_UM

    @property
    def wavelengths_um(self) -> None:
        """A plate may be computed at any wavelength."""
        return

    def layout(self, corner_mm: float, fields: int) -> FieldLayout:
        """Return one place: streaks are never turned."""
        del corner_mm, fields
        return uniform_layout()

    def kernels(
        self,
        fields: FieldLayout,
        wavelengths_um: FloatGrid,
        *,
        depth_mm: float,
        side_px: int,
        pitch_um: float,
    ) -> TracedPsf:
        """Compute the kernels; the sensor stays where the bench has it.

        Raises:
            ContractError: If several places are asked for, or `plate_psf` refuses.
        """
        if fields.symmetry != "uniform":
            raise ContractError("a plate has the same kernels everywhere; ask for one place")
        grid = PixelGrid(side_px=side_px, pitch_um=pitch_um)
        waves = tuple(float(wave) for wave in wavelengths_um)
        light = _stack(self.plate, grid, depth_mm, waves, bare=False).to(torch.float64)[None]
        energy = light.sum((-2, -1))
        return TracedPsf(kernels=light / energy[..., None, None], energy_kept=energy)

    def distortion(self, radius_mm: float, channels: int) -> RadialDistortion:
        """Return none: the stop lies in the lens, which is thin."""
        rows = np.tile(np.array([[1.0, 0.0, 0.0, 0.0]]), (channels, 1))
        return RadialDistortion(coefficients=rows, radius_mm=radius_mm)

    def illumination(self, fields: FieldLayout) -> FloatGrid:
        """Return even light: the fall-off of an ideal lens is left to the camera it stands in."""
        return np.ones(fields.count)

    def copies(self, count: int, seed: int) -> "tuple[PlateOptics, ...]":
        """Return itself: how well it will be etched is not known."""
        del count, seed
        return (self,)


# freezing asks again for the same wavelengths with fewer of them kept
@lru_cache(maxsize=8)
def _stack(
    plate: Plate, grid: PixelGrid, depth_mm: float, wavelengths_um: tuple[float, ...], *, bare: bool
) -> Tensor:
    """Return the light (wavelength, side, side) of a point; not to be written to."""
    with torch.no_grad():
        return torch.stack(
            [plate.psf(wave, grid, depth_mm, bare=bare).float() for wave in wavelengths_um]
        )

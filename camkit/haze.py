"""The haze of optics: what light falls far from its peak, in coarse cells beside the core kernels.

a point's light = core_share x core kernel (pixels, the frozen PSF) + haze (cells) + what is lost
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.psf import FrozenPsf

LEAST_CELL_PX: Final = 4
MOST_CELL_PX: Final = 64
MOST_CELLS: Final = 257
"""Along a side of a kernel."""
MOST_FIELDS: Final = 33
MOST_LIGHT: Final = 1 + 1e-4
LEAST_SHARE: Final = 0.01
"""Of the light in a core: the capture is divided by it."""
_AXES: Final = ("field_heights_mm", "depths_mm", "wavelengths_um")
FloatGrid = NDArray[np.float64]


def without_pedestal(kernels: FloatArray, core_share: NDArray[Any], share: float) -> FloatArray:
    """Subtract an even pedestal from kernels of haze: black that was taken for light.

    Args:
        kernels: (..., n, n) share of a point's light in every cell.
        core_share: (...) share of it in the core.
        share: Of all its light, core and haze, that is black; a cell with less than its part was
            dark.
    """
    light = kernels.sum(axis=(-2, -1), dtype=np.float64) + core_share
    even = (share / kernels.shape[-1] ** 2) * light
    return np.asarray(np.maximum(kernels - even[..., None, None], 0), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Haze:
    """The haze that lies beside the core kernels of a frozen PSF, at its samples.

    Shares are of the light that reaches the sensor's plane; what is missing to 1 falls beside the
    kernels. Symmetry and places are those of the PSF.

    Attributes:
        kernels: (field, depth, wavelength, n, n) float32 >= 0, n odd: share of a point's light in
            every cell, the middle one about its peak; the mean over points of one cell.
        core_share: (field, depth, wavelength) float64: share of the light in the core kernel.
        field_heights_mm: (field,) float64, distance of the peak from the axis.
        depths_mm: (depth,) float64.
        wavelengths_um: (wavelength,) float64.
        cell_px: Side of a cell in pixels, even.
        pixel_pitch_um: Of the sensor.
    """

    kernels: FloatArray
    core_share: FloatGrid
    field_heights_mm: FloatGrid
    depths_mm: FloatGrid
    wavelengths_um: FloatGrid
    cell_px: int
    pixel_pitch_um: float

    def __post_init__(self) -> None:
        """Refuse arrays that are no haze.

        Raises:
            ContractError: If shapes disagree, or light is not a share of what arrives.
        """
        lead = tuple(int(getattr(self, name).size) for name in _AXES)
        shape, side = self.kernels.shape, self.kernels.shape[-1]
        if (
            self.kernels.dtype != np.float32
            or shape != (*lead, side, side)
            or self.core_share.shape != lead
        ):
            raise ContractError(
                f"haze must be float32 {(*lead, 'n', 'n')} with a core share each; got "
                f"{self.kernels.dtype} {shape}, {self.core_share.shape}"
            )
        if side % 2 == 0 or not 0 < side <= MOST_CELLS:
            raise ContractError(f"haze needs an odd side of at most {MOST_CELLS} cells; got {side}")
        if lead[0] > MOST_FIELDS:
            raise ContractError(f"haze is known at {MOST_FIELDS} fields at most; got {lead[0]}")
        if self.cell_px % 2 or not LEAST_CELL_PX <= self.cell_px <= MOST_CELL_PX:
            raise ContractError(
                f"cells of haze have an even side of {LEAST_CELL_PX} to {MOST_CELL_PX} px; got "
                f"{self.cell_px}"
            )
        if not (np.isfinite(self.pixel_pitch_um) and self.pixel_pitch_um > 0):
            raise ContractError(f"pixel_pitch_um must be > 0; got {self.pixel_pitch_um}")
        self._check_light()

    @property
    def most_share(self) -> float:
        """Return the largest share of a point's light on the kernels that is haze."""
        haze = self.kernels.sum(axis=(-2, -1), dtype=np.float64)
        return float((haze / (haze + self.core_share)).max())

    def _check_light(self) -> None:
        if not np.isfinite(self.kernels).all() or (self.kernels < 0).any():
            raise ContractError("haze must be finite and >= 0; freeze the optics again")
        share = self.core_share
        if not ((share >= LEAST_SHARE) & (share <= MOST_LIGHT)).all():
            raise ContractError(
                f"a core holds {LEAST_SHARE} to 1 of the light; got {share.ravel()}"
            )
        most = float((share + self.kernels.sum(axis=(-2, -1), dtype=np.float64)).max())
        if most > MOST_LIGHT:
            raise ContractError(f"core and haze hold more than all the light: {most:.6f}")

    def check_beside(self, psf: FrozenPsf) -> None:
        """Refuse a PSF of other samples.

        Raises:
            ContractError: If fields, depths, wavelengths or pitch are not those of the haze, or
                the PSF knows kernels of a moved sensor, whose haze nobody knows.
        """
        for name in _AXES:
            if not np.array_equal(getattr(self, name), getattr(psf, name)):
                raise ContractError(
                    f"haze and core kernels have different {name}: "
                    f"{getattr(self, name)}, {getattr(psf, name)}; freeze them together"
                )
        if self.pixel_pitch_um != psf.pixel_pitch_um:
            raise ContractError(
                f"haze is of pixels of {self.pixel_pitch_um} um, its core kernels of "
                f"{psf.pixel_pitch_um} um"
            )
        if psf.focus_um is not None:
            raise ContractError(
                f"kernels of a moved sensor have no haze; freeze without {option_text('focus_um')}"
            )

"""A PSF that was measured, or computed elsewhere, as freezing sees it: known at its own samples.

Between its places, depths and wavelengths kernels are blended as every lookup blends them; beyond
its depths nothing is known. It is frozen at the places and wavelengths that it has: others would
hold no more.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.bundle.psf_file import read_measurement
from camkit.calibration.psf_import.kernel_resampling import resampled_kernels, window
from camkit.calibration.psf_import.kernel_uncertainty import drawn_psf
from camkit.errors import ContractError
from camkit.models_def.optics.freezable_optics import (
    FieldLayout,
    FloatGrid,
    grid_layout,
    radial_layout,
    uniform_layout,
)
from camkit.models_def.optics.psf import TracedPsf
from camkit.psf import FrozenPsf, PsfUncertainty, depth_weights, grid_heights_mm
from camkit.radial import RadialDistortion
from camkit.runtime.bank.psf import FieldKernels

MEASURED: Final = ".safetensors"


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredOptics:
    """Optics known by kernels; fulfils `camkit.models_def.optics.freezable_optics.Optics`.

    Attributes:
        psf: The kernels, at any pitch.
        name: For people.
        uncertainty: How far they may be off; None if not known.
    """

    psf: FrozenPsf
    name: str
    uncertainty: PsfUncertainty | None = None

    @property
    def facts(self) -> Mapping[str, float]:
        """No facts: nothing but the kernels is known."""
        return {}

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """The depths at which it was measured."""
        return tuple(self.psf.depths_mm.tolist())

    @property
    def focus_mm(self) -> float:
        """The farthest depth at which it was measured."""
        return float(self.psf.depths_mm[-1])

    @property
    def reference_wavelength_um(self) -> float:
        """The middle one of those at which it was measured."""
        return float(self.psf.wavelengths_um[self.psf.wavelengths_um.size // 2])

    @property
    def wavelengths_um(self) -> FloatGrid:
        """The wavelengths at which it was measured."""
        return self.psf.wavelengths_um

    def layout(self, corner_mm: float, fields: int) -> FieldLayout:
        """Return the places at which it was measured."""
        del corner_mm, fields
        psf = self.psf
        if psf.grid_x_mm is not None and psf.grid_y_mm is not None:
            return grid_layout(psf.grid_x_mm, psf.grid_y_mm)
        return (
            uniform_layout() if psf.symmetry == "uniform" else radial_layout(psf.field_heights_mm)
        )

    def kernels(
        self,
        fields: FieldLayout,
        wavelengths_um: FloatGrid,
        *,
        depth_mm: float,
        side_px: int,
        pitch_um: float,
    ) -> TracedPsf:
        """Blend the kernels to places, depth and wavelengths, at another pitch if need be.

        Raises:
            ContractError: If the depth lies beyond those measured.
        """
        psf = self.psf
        shares = depth_weights(psf.depths_mm, depth_mm)
        at_depth = np.einsum("d,fdlhw->flhw", shares, psf.kernels.astype(np.float64))
        units = np.eye(psf.wavelengths_um.size)
        hats = np.stack([np.interp(wavelengths_um, psf.wavelengths_um, unit) for unit in units])
        field_kernels = FieldKernels(
            kernels=np.einsum("ln,flhw->fnhw", hats, at_depth).astype(np.float32),
            field_heights_mm=psf.field_heights_mm,
            symmetry=psf.symmetry,
            grid_x_mm=psf.grid_x_mm,
            grid_y_mm=psf.grid_y_mm,
        )
        places = zip(fields.x_mm.tolist(), fields.y_mm.tolist(), strict=True)
        blended = np.stack([field_kernels.at(x_mm, y_mm) for x_mm, y_mm in places]).astype(
            np.float64
        )
        resampled = resampled_kernels(blended, psf.pixel_pitch_um / pitch_um)
        wide_kernels = torch.from_numpy(resampled)
        inside = torch.from_numpy(window(resampled, side_px))
        energy = inside.sum((-2, -1)) / wide_kernels.sum((-2, -1))
        return TracedPsf(
            kernels=inside / inside.sum((-2, -1), keepdim=True).clamp_min(1e-30), energy_kept=energy
        )

    def distortion(self, radius_mm: float, channels: int) -> RadialDistortion:
        """Return the distortion as measured, for every channel; one row stands for all.

        Raises:
            ContractError: If it was measured for another number of channels.
        """
        del radius_mm
        rows = self.psf.distortion.coefficients
        if len(rows) not in (1, channels):
            raise ContractError(
                f"{self.name} has the distortion of {len(rows)} channels, the sensor {channels}"
            )
        coefficients = np.ascontiguousarray(np.broadcast_to(rows, (channels, 4)))
        even = self.psf.distortion.even_coefficients
        if even is not None:
            even = np.ascontiguousarray(np.broadcast_to(even, (channels, 3)))
        return replace(self.psf.distortion, coefficients=coefficients, even_coefficients=even)

    def illumination(self, fields: FieldLayout) -> FloatGrid:
        """Return the relative illumination, blended as kernels are."""
        psf, light = self.psf, self.psf.relative_illumination
        if psf.grid_x_mm is not None and psf.grid_y_mm is not None:
            rows = light.reshape(psf.grid_y_mm.size, psf.grid_x_mm.size)
            along_x = np.stack([np.interp(fields.x_mm, psf.grid_x_mm, row) for row in rows])
            places = zip(fields.y_mm, along_x.T, strict=True)
            return np.array([np.interp(y_mm, psf.grid_y_mm, line) for y_mm, line in places])
        return np.interp(np.hypot(fields.x_mm, fields.y_mm), psf.field_heights_mm, light)

    def copies(self, count: int, seed: int) -> "tuple[MeasuredOptics, ...]":
        """Return itself and kernels drawn within their uncertainty; itself alone without one."""
        if self.uncertainty is None:
            return (self,)
        rng = np.random.default_rng(seed)
        drawn_psfs = [drawn_psf(self.psf, self.uncertainty, rng) for _ in range(count - 1)]
        return (self, *(replace(self, psf=psf) for psf in drawn_psfs))


def find_measured(name: str, folder: Path | None = None) -> MeasuredOptics:
    """Return the PSF that a recipe names.

    Args:
        name: Path of a .safetensors file relative to `folder`.
        folder: Of the recipe; None for the working directory.

    Raises:
        ContractError: If there is none, or it is another kind of file.
        BundleError: If it is damaged.
    """
    path = (folder or Path()) / name
    if path.suffix.lower() != MEASURED:
        raise ContractError(
            f"lens.psf names a PSF of camkit ({MEASURED}); got {name}: convert it by "
            "`camkit psf import`"
        )
    if not path.is_file():
        raise ContractError(f"lens.psf: there is no {path}; make it by `camkit psf import`")
    return read_measured(path)


def read_measured(path: Path) -> MeasuredOptics:
    """Read a PSF file (`camkit/bundle/psf_file.py`).

    Raises:
        BundleError: If it is missing, damaged or not a PSF.
    """
    psf, uncertainty = read_measurement(path)
    return MeasuredOptics(psf=psf, name=path.stem, uncertainty=uncertainty)


def measured_psf(
    kernels: NDArray[np.floating],
    *,
    pixel_pitch_um: float,
    wavelengths_um: tuple[float, ...],
    grid_mm: tuple[FloatGrid, FloatGrid] | None = None,
    depth_mm: float = np.inf,
) -> FrozenPsf:
    """Make a PSF of arrays: of one depth, without distortion, of even light.

    Args:
        kernels: (wavelength, h, w) for the same everywhere, or (row, column, wavelength, h, w) on
            a grid; >= 0 and of any sum, odd sides, centred on the chief ray.
        pixel_pitch_um: Of their samples.
        wavelengths_um: Increasing.
        grid_mm: (column,) and (row,) positions of a grid.
        depth_mm: At which they were measured.

    Raises:
        ContractError: If the shapes disagree, or a kernel is none.
    """
    places = (1, 1) if grid_mm is None else (grid_mm[1].size, grid_mm[0].size)
    if kernels.ndim != (3 if grid_mm is None else 5) or kernels.shape[:-3] not in ((), places):
        raise ContractError(
            f"kernels must be {'' if grid_mm is None else 'row, column, '}wavelength, h, w for "
            f"{places[0]} x {places[1]} places; got {kernels.shape}"
        )
    fields = kernels.reshape(places[0] * places[1], 1, *kernels.shape[-3:]).astype(np.float64)
    sums = fields.sum((-2, -1), keepdims=True)
    if not (sums > 0).all():
        raise ContractError("every kernel needs light")
    return FrozenPsf(
        kernels=np.ascontiguousarray(fields / sums, dtype=np.float32),
        field_heights_mm=np.zeros(1) if grid_mm is None else grid_heights_mm(*grid_mm),
        depths_mm=np.array([depth_mm]),
        wavelengths_um=np.array(wavelengths_um),
        pixel_pitch_um=pixel_pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(places[0] * places[1]),
        symmetry="uniform" if grid_mm is None else "grid",
        grid_x_mm=None if grid_mm is None else grid_mm[0],
        grid_y_mm=None if grid_mm is None else grid_mm[1],
    )

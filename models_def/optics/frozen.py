"""Optics in front of a sensor become a `FrozenPsf` on a given grid.

    kernels at fine wavelengths -> choose the kernel side -> average over wavelength bands
    -> match the camera's colours -> FrozenPsf

A kernel of the frozen PSF is the average over the triangle of wavelengths that the lookup gives
to its sample (flat spectrum), not the kernel at one wavelength: lateral colour then smears as in
the lens and does not fall apart into separate images. What is still wrong in the colours of the
camera it is frozen for is taken out by Richardson-Lucy steps, so few wavelengths suffice. Optics
that are known at wavelengths of their own keep those.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.bundle.sensor import ColorSensor
from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.models_def.optics.freezable_optics import FieldLayout, FloatGrid, Optics, radial_layout
from camkit.models_def.optics.psf import TracedPsf
from camkit.progress import working
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import wavelength_weights
from camkit.units import MM_PER_M, UM_PER_MM

STRESS_OFFSETS_PER_M: Final = (0.02, 0.05, 0.1, 0.2)
"""How far off the nearest and the farthest design distance, in 1 / m."""
STRESS_FIELDS: Final = (0.0, 0.7, 1.0)
STRESS_WAVELENGTHS: Final = 3
STRESS_LOSS: Final = 4.0
"""Of the light that a grid may lose, since out of focus it spreads further."""
FINE_WAVELENGTHS: Final = 25
KERNEL_BITS: Final = 12
_FLOAT_BITS: Final = 23
_MATCH_STEPS: Final = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class FreezeGrid:
    """The samples of a PSF over field, depth and wavelength.

    Attributes:
        fields: Samples from the axis to the corner, see `Optics.layout`.
        wavelengths: Evenly spaced over the response of the sensor.
        depths_mm: Object distances, increasing; the sensor stays where it is. Empty for those of
            the optics.
        energy: Least share of the light of every colour that the kernels must hold.
        max_side_px: Largest odd kernel side.
        least_side_px: Smallest one.
        least_energy: What kernels of that side must hold where they do not hold `energy`; None:
            `energy`.
    """

    fields: int = 13
    wavelengths: int = 7
    depths_mm: tuple[float, ...] = ()
    energy: float = 0.995
    max_side_px: int = 151
    least_side_px: int = 3
    least_energy: float | None = None

    def __post_init__(self) -> None:
        if self.fields < 2 or self.wavelengths < 1:
            raise ContractError(f"a PSF needs 2 fields and 1 wavelength; got {self}")
        if any(near >= far for near, far in pairwise((0.0, *self.depths_mm))):
            raise ContractError(f"depths must increase from above 0 mm; got {self.depths_mm}")
        sides = self.least_side_px, self.max_side_px
        if not all(side % 2 for side in sides) or not 0 < self.energy <= 1:
            raise ContractError(f"need odd sides and an energy in 0..1; got {sides}, {self.energy}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """A frozen PSF and the light its kernels hold.

    Attributes:
        psf: What the bundle stores.
        energy_kept: Least share of the light of a colour inside the kernels.
    """

    psf: FrozenPsf
    energy_kept: float


def corner_height_mm(sensor: ColorSensor) -> float:
    """Return half the diagonal of the sensor, by its outermost pixel edges."""
    diagonal_px = math.hypot(sensor.width_px, sensor.height_px)
    return diagonal_px / 2 * sensor.pixel_pitch_um / UM_PER_MM


def freeze(optics: Optics, sensor: ColorSensor, grid: FreezeGrid | None = None) -> Frozen:
    """Freeze the PSF of optics on a grid of fields, depths and wavelengths.

    Args:
        optics: What stands in front of the sensor.
        sensor: Size, pitch and colour response.
        grid: 13 fields, 7 wavelengths, the depths of the optics by default.

    Raises:
        ContractError: If the largest side does not hold the wanted light.
    """
    freeze_grid = grid or FreezeGrid()
    layout = optics.layout(corner_height_mm(sensor), freeze_grid.fields)
    return freeze_at(optics, sensor, freeze_grid, layout)


def freeze_at(optics: Optics, sensor: ColorSensor, grid: FreezeGrid, fields: FieldLayout) -> Frozen:
    """Freeze the PSF at given places (`grid.fields` is not used)."""
    response_um, response = sensor.response_arrays()
    waves_um, fine_um, bands = _wavelengths(optics, grid, response_um)
    depths_mm = grid.depths_mm or optics.depths_mm
    traced = [
        optics.kernels(
            fields,
            fine_um,
            depth_mm=depth_mm,
            side_px=grid.max_side_px,
            pitch_um=sensor.pixel_pitch_um,
        )
        for depth_mm in depths_mm
    ]
    weights = torch.from_numpy(wavelength_weights(fine_um, response_um, response))
    side_px, energy = _smallest_side(traced, weights, grid, fields)
    averaged = [_average(t, bands, side_px) for t in traced]
    if optics.wavelengths_um is None:
        share = torch.from_numpy(wavelength_weights(waves_um, response_um, response))
        averaged = [
            _match_colours(kernels, _average(t, weights, side_px), share)
            for kernels, t in zip(averaged, traced, strict=True)
        ]
    psf = FrozenPsf(
        kernels=rounded(torch.stack(averaged, dim=1).to(torch.float32).numpy()),
        field_heights_mm=fields.heights_mm,
        depths_mm=np.array(depths_mm, dtype=np.float64),
        wavelengths_um=waves_um,
        pixel_pitch_um=sensor.pixel_pitch_um,
        distortion=optics.distortion(corner_height_mm(sensor), len(sensor.channels)),
        relative_illumination=optics.illumination(fields),
        symmetry=fields.symmetry,
        grid_x_mm=fields.grid_x_mm,
        grid_y_mm=fields.grid_y_mm,
    )
    return Frozen(psf=psf, energy_kept=energy)


def with_focus(
    psf: FrozenPsf,
    shifts_um: tuple[float, ...],
    refocused: Callable[[float], Optics],
    sensor: ColorSensor,
) -> tuple[FrozenPsf, float]:
    """Add the kernels of cameras whose sensor is moved; those of the nominal one stay as they are.

    They have the places, depths, wavelengths and side of the PSF, so they may hold less light.

    Args:
        psf: Frozen at the nominal focus, of radial optics.
        shifts_um: How far the sensor is moved away from the lens, increasing, to both sides of 0.
        refocused: Gives the optics before a sensor that is moved so.
        sensor: That the PSF was frozen for.

    Returns:
        The PSF with kernels of every shift, and the least share of the light of a colour in them.
    """
    side_px = int(psf.kernels.shape[-1])
    grid = FreezeGrid(
        wavelengths=psf.wavelengths_um.size,
        depths_mm=tuple(psf.depths_mm.tolist()),
        least_side_px=side_px,
        max_side_px=side_px,
        least_energy=0.0,
    )
    fields = radial_layout(psf.field_heights_mm.copy())
    shifted = [freeze_at(refocused(shift_um), sensor, grid, fields) for shift_um in shifts_um]
    added = replace(
        psf,
        focus_um=np.array(shifts_um, dtype=np.float64),
        focus_kernels=np.stack([one.psf.kernels for one in shifted]),
    )
    return added, min(one.energy_kept for one in shifted)


def _wavelengths(
    optics: Optics, grid: FreezeGrid, response_um: FloatGrid
) -> tuple[FloatGrid, FloatGrid, Tensor]:
    """Return the wavelengths to keep, those to ask for, and (kept, asked) weights between them."""
    own_um = optics.wavelengths_um
    if own_um is not None:
        return own_um, own_um, torch.eye(own_um.size, dtype=torch.float64)
    waves_um = np.linspace(response_um[0], response_um[-1], grid.wavelengths)
    if grid.wavelengths == 1:
        waves_um = np.array([optics.reference_wavelength_um])
    return waves_um, *wavelength_bands(waves_um)


def rounded(kernels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to `KERNEL_BITS` of mantissa: what is cut is noise of the rays, and does not compress.

    No kernel value changes by more than 1 in 8192; sums stay 1 to a few 1e-6.
    """
    spare = np.uint32(_FLOAT_BITS - KERNEL_BITS)
    half = np.uint32(1) << (spare - np.uint32(1))
    bits = (np.ascontiguousarray(kernels).view(np.uint32) + half) >> spare << spare
    return bits.view(np.float32)


def dense_grid(grid: FreezeGrid) -> FreezeGrid:
    """Return the grid with twice the field and three times the wavelength density."""
    return replace(grid, fields=2 * grid.fields - 1, wavelengths=3 * grid.wavelengths - 2)


def stress_depths_mm(depths_mm: tuple[float, ...]) -> tuple[float, ...]:
    """Return the distances to stress a lens at: its own, and some nearer and farther than all.

    Args:
        depths_mm: Distances it was made for, increasing; infinity is allowed.

    Returns:
        Increasing, up to infinity where the offsets reach it.
    """
    near, far = MM_PER_M / depths_mm[0], MM_PER_M / depths_mm[-1]
    distances_mm = {MM_PER_M / (near + offset) for offset in STRESS_OFFSETS_PER_M}
    distances_mm |= {
        MM_PER_M / (far - offset) if far > offset else math.inf for offset in STRESS_OFFSETS_PER_M
    }
    return tuple(sorted({*distances_mm, *depths_mm}))


@working("freezing kernels off the design point")
def freeze_stress(optics: Optics, sensor: ColorSensor, grid: FreezeGrid | None = None) -> Frozen:
    """Freeze kernels off the design point: object distances, at three fields of radial optics.

    The sensor stays where it is, so an offset in 1 / distance moves the image by EFL^2 times it.

    Raises:
        ContractError: If the optics are not known off their depths.
    """
    base = grid or FreezeGrid()
    stress = replace(
        base,
        depths_mm=stress_depths_mm(base.depths_mm or optics.depths_mm),
        wavelengths=STRESS_WAVELENGTHS,
        energy=max(1 - STRESS_LOSS * (1 - base.energy), base.energy / 2),
    )
    corner_mm = corner_height_mm(sensor)
    layout = optics.layout(corner_mm, len(STRESS_FIELDS))
    if layout.symmetry == "radial":
        layout = radial_layout(np.array(STRESS_FIELDS) * corner_mm)
    return freeze_at(optics, sensor, stress, layout)


def wavelength_bands(waves_um: FloatGrid) -> tuple[FloatGrid, Tensor]:
    """Return fine wavelengths and (sample, fine) weights: triangles around the samples."""
    steps = max(waves_um.size - 1, 1)
    # a whole number of fine steps per sample
    count = steps * -(-(FINE_WAVELENGTHS - 1) // steps) + 1
    fine_um = np.linspace(waves_um[0], waves_um[-1], count if waves_um.size > 1 else 1)
    triangles = np.stack([np.interp(fine_um, waves_um, unit) for unit in np.eye(waves_um.size)])
    return fine_um, torch.from_numpy(triangles / triangles.sum(axis=1, keepdims=True))


def _smallest_side(
    traced: list[TracedPsf], weights: Tensor, grid: FreezeGrid, fields: FieldLayout
) -> tuple[int, float]:
    """Return smallest odd side that holds the wanted light of every colour, and what it holds."""
    full = torch.stack([t.kernels * t.energy_kept[..., None, None] for t in traced])
    colours = torch.einsum("cw,dfwij->dfcij", weights, full)
    light = torch.zeros(len(fields.heights_mm), dtype=torch.float64)
    energy = 0.0
    for side_px in range(grid.least_side_px, grid.max_side_px + 1, 2):
        light = _centre(colours, side_px).sum((-2, -1)).amin((0, 2))
        energy = float(light.min())
        if energy >= grid.energy:
            return side_px, energy
    if grid.least_energy is not None and energy >= grid.least_energy:
        return grid.max_side_px, energy
    height_mm = fields.heights_mm[int(light.argmin())]
    raise ContractError(
        f"kernels of {grid.max_side_px} px hold {energy:.4f} of the light {height_mm:.3g} mm from "
        f"the axis ({float(light[0]):.4f} on it), wanted {grid.energy}; stop the lens down, take "
        f"larger pixels or a smaller sensor, or raise {option_text('max_side_px')} of "
        f"{command_text('freeze')}"
    )


def _average(traced: TracedPsf, bands: Tensor, side_px: int) -> Tensor:
    full = traced.kernels * traced.energy_kept[..., None, None]
    kernels = _centre(torch.einsum("sw,fwij->fsij", bands, full), side_px)
    return kernels / kernels.sum((-2, -1), keepdim=True)


def _match_colours(kernels: Tensor, colours: Tensor, share: Tensor) -> Tensor:
    """Adjust kernels until the lookup's weights give the camera's colours exactly.

    Richardson-Lucy steps on colours = share @ kernels, from the band averages: never negative.

    Args:
        kernels: (field, wavelength, h, w), start.
        colours: (field, c, h, w), wanted.
        share: (c, wavelength), what the lookup will weight them with.
    """
    total = share.sum(0)
    sensitive = (total > 1e-6)[:, None, None]
    scale = torch.where(total > 1e-6, total, 1.0)[:, None, None]
    for _ in range(_MATCH_STEPS):
        mixture = torch.einsum("cs,fsij->fcij", share, kernels)
        ratio = torch.where(mixture > 1e-15, colours / mixture.clamp_min(1e-15), 1.0)
        factor = torch.einsum("cs,fcij->fsij", share, ratio) / scale
        kernels = kernels * torch.where(sensitive, factor, 1.0)
        kernels = kernels / kernels.sum((-2, -1), keepdim=True)
    return kernels


def _centre(kernels: Tensor, side_px: int) -> Tensor:
    cut = (kernels.shape[-1] - side_px) // 2
    return kernels[..., cut : cut + side_px, cut : cut + side_px]

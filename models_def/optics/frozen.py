"""A lens in front of a camera becomes a `FrozenPsf` on a given grid.

    trace finely -> choose the kernel side -> average over wavelength bands
    -> match the camera's colours -> FrozenPsf

A kernel of the frozen PSF is the average over the triangle of wavelengths that the lookup gives
to its sample (flat spectrum), not the kernel at one wavelength: lateral colour then smears as in
the lens and does not fall apart into separate images. What is still wrong in the colours of the
camera it is frozen for is taken out by Richardson-Lucy steps, so few wavelengths suffice.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.bundle.camera import Camera
from camkit.contracts import FrozenPsf
from camkit.errors import ContractError
from camkit.models_def.optics.analysis.illumination import relative_illumination_at
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import TracedPsf, trace_psf, with_object_distance
from camkit.models_def.sensors.psf import wavelength_weights
from camkit.units import MM_PER_M, UM_PER_MM

FloatGrid = NDArray[np.float64]

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
    """Where a PSF is sampled.

    Attributes:
        fields: Heights from the axis to the corner, evenly spaced.
        wavelengths: Evenly spaced over the camera's response.
        depths_mm: Object distances, increasing; the sensor stays where the lens has it. Empty
            for that of the lens.
        energy: Least share of the light of every colour that the kernels must hold.
        max_side_px: Largest odd kernel side.
        least_energy: What kernels of that side must hold where they do not hold `energy`; None:
            `energy`.
        rays: In half the pupil, per wavelength traced.
    """

    fields: int = 13
    wavelengths: int = 7
    depths_mm: tuple[float, ...] = ()
    energy: float = 0.995
    max_side_px: int = 151
    least_energy: float | None = None
    rays: int = 4096

    def __post_init__(self) -> None:
        if self.fields < 2 or self.wavelengths < 1:
            raise ContractError(f"a PSF needs 2 fields and 1 wavelength; got {self}")
        if any(near >= far for near, far in pairwise((0.0, *self.depths_mm))):
            raise ContractError(f"depths must increase from above 0 mm; got {self.depths_mm}")
        if self.max_side_px % 2 == 0 or not 0 < self.energy <= 1:
            raise ContractError(
                f"need an odd side and an energy in 0..1; got {self.max_side_px}, {self.energy}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """A frozen PSF and the light its kernels hold.

    Attributes:
        psf: What the bundle stores.
        energy_kept: Least share of the light of a colour inside the kernels.
    """

    psf: FrozenPsf
    energy_kept: float


def corner_height_mm(camera: Camera) -> float:
    """Give half the diagonal of the sensor, by its outermost pixel edges."""
    diagonal_px = math.hypot(camera.width_px, camera.height_px)
    return diagonal_px / 2 * camera.pixel_pitch_um / UM_PER_MM


def freeze(lens: Lens, camera: Camera, grid: FreezeGrid | None = None) -> Frozen:
    """Trace the PSF of a lens on a grid of fields, depths and wavelengths.

    Distortion and illumination are those at the lens's own object distance.

    Args:
        lens: The prescription.
        camera: Sensor size, pitch and colour response.
        grid: 13 fields, 7 wavelengths, the distance of the lens by default.

    Raises:
        ContractError: If the largest side does not hold the wanted light.
    """
    chosen = grid or FreezeGrid()
    heights_mm = np.linspace(0.0, corner_height_mm(camera), chosen.fields)
    return freeze_at(lens, camera, chosen, heights_mm)


def freeze_at(lens: Lens, camera: Camera, grid: FreezeGrid, heights_mm: FloatGrid) -> Frozen:
    """Trace the PSF at given sensor heights (`grid.fields` is not used)."""
    response_um, response = camera.channel_response.to_arrays()
    waves_um = np.linspace(response_um[0], response_um[-1], grid.wavelengths)
    if grid.wavelengths == 1:
        waves_um = np.array([lens.reference_wavelength_um])
    fine_um, bands = _bands(waves_um)
    depths_mm = grid.depths_mm or (lens.object_distance_mm,)
    traced = [
        _trace(with_object_distance(lens, depth), camera, grid, (heights_mm, fine_um))
        for depth in depths_mm
    ]
    weights = torch.from_numpy(wavelength_weights(fine_um, response_um, response))
    side_px, kept = _smallest_side(traced, weights, grid)
    share = torch.from_numpy(wavelength_weights(waves_um, response_um, response))
    kernels = torch.stack(
        [
            _match_colours(_average(t, bands, side_px), _average(t, weights, side_px), share)
            for t in traced
        ],
        dim=1,
    )
    light = relative_illumination_at(lens, torch.from_numpy(heights_mm))
    psf = FrozenPsf(
        kernels=_rounded(kernels.to(torch.float32).numpy()),
        field_heights_mm=heights_mm,
        depths_mm=np.array(depths_mm, dtype=np.float64),
        wavelengths_um=waves_um,
        pixel_pitch_um=camera.pixel_pitch_um,
        distortion=trace_distortion(lens, corner_height_mm(camera)),
        relative_illumination=light.numpy() / float(light[0]),
    )
    return Frozen(psf=psf, energy_kept=kept)


def _rounded(kernels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Round to `KERNEL_BITS` of mantissa: what is cut is noise of the rays, and does not compress.

    No kernel value changes by more than 1 in 8192; sums stay 1 to a few 1e-6.
    """
    spare = np.uint32(_FLOAT_BITS - KERNEL_BITS)
    half = np.uint32(1) << (spare - np.uint32(1))
    bits = (np.ascontiguousarray(kernels).view(np.uint32) + half) >> spare << spare
    return bits.view(np.float32)


def dense_grid(grid: FreezeGrid) -> FreezeGrid:
    """Give the grid with twice the field and three times the wavelength density."""
    return replace(grid, fields=2 * grid.fields - 1, wavelengths=3 * grid.wavelengths - 2)


def stress_depths_mm(depths_mm: tuple[float, ...]) -> tuple[float, ...]:
    """Give the distances to stress a lens at: its own, and some nearer and farther than all.

    Args:
        depths_mm: Distances it was made for, increasing; infinity is allowed.

    Returns:
        Increasing, up to infinity where the offsets reach it.
    """
    near, far = MM_PER_M / depths_mm[0], MM_PER_M / depths_mm[-1]
    found = {MM_PER_M / (near + offset) for offset in STRESS_OFFSETS_PER_M}
    found |= {
        MM_PER_M / (far - offset) if far > offset else math.inf for offset in STRESS_OFFSETS_PER_M
    }
    return tuple(sorted({*found, *depths_mm}))


def freeze_stress(lens: Lens, camera: Camera, grid: FreezeGrid | None = None) -> Frozen:
    """Trace kernels off the design point: object distances at three fields.

    The sensor stays where it is, so an offset in 1 / distance moves the image by EFL^2 times it.
    """
    base = grid or FreezeGrid()
    stress = replace(
        base,
        depths_mm=stress_depths_mm(base.depths_mm or (lens.object_distance_mm,)),
        wavelengths=STRESS_WAVELENGTHS,
        energy=max(1 - STRESS_LOSS * (1 - base.energy), base.energy / 2),
    )
    heights_mm = np.array(STRESS_FIELDS) * corner_height_mm(camera)
    return freeze_at(lens, camera, stress, heights_mm)


def _bands(waves_um: FloatGrid) -> tuple[FloatGrid, Tensor]:
    """Give fine wavelengths and (sample, fine) weights: triangles around the samples."""
    steps = max(waves_um.size - 1, 1)
    # a whole number of fine steps per sample
    count = steps * -(-(FINE_WAVELENGTHS - 1) // steps) + 1
    fine_um = np.linspace(waves_um[0], waves_um[-1], count if waves_um.size > 1 else 1)
    triangles = np.stack([np.interp(fine_um, waves_um, unit) for unit in np.eye(waves_um.size)])
    return fine_um, torch.from_numpy(triangles / triangles.sum(axis=1, keepdims=True))


def _trace(
    lens: Lens, camera: Camera, grid: FreezeGrid, at: tuple[FloatGrid, FloatGrid]
) -> TracedPsf:
    heights_mm, waves_um = (torch.from_numpy(values) for values in at)
    with torch.no_grad():
        return trace_psf(
            lens, heights_mm, waves_um, grid.max_side_px, camera.pixel_pitch_um, rays=grid.rays
        )


def _smallest_side(traced: list[TracedPsf], weights: Tensor, grid: FreezeGrid) -> tuple[int, float]:
    """Give the smallest odd side that holds the wanted light of every colour, and what it holds."""
    full = torch.stack([t.kernels * t.energy_kept[..., None, None] for t in traced])
    colours = torch.einsum("cw,dfwij->dfcij", weights, full)
    kept = 0.0
    for side_px in range(3, grid.max_side_px + 1, 2):
        kept = float(_centre(colours, side_px).sum((-2, -1)).min())
        if kept >= grid.energy:
            return side_px, kept
    if grid.least_energy is not None and kept >= grid.least_energy:
        return grid.max_side_px, kept
    raise ContractError(
        f"kernels of {grid.max_side_px} px hold {kept:.4f} of the light, wanted {grid.energy}; "
        "raise max_side_px, lower the energy, or use a better lens"
    )


def _average(traced: TracedPsf, bands: Tensor, side_px: int) -> Tensor:
    full = traced.kernels * traced.energy_kept[..., None, None]
    kernels = _centre(torch.einsum("sw,fwij->fsij", bands, full), side_px)
    return kernels / kernels.sum((-2, -1), keepdim=True)


def _match_colours(kernels: Tensor, colours: Tensor, share: Tensor) -> Tensor:
    """Change kernels until the lookup's weights give the camera's colours exactly.

    Richardson-Lucy steps on colours = share @ kernels, from the band averages: never negative.

    Args:
        kernels: (field, wavelength, h, w), start.
        colours: (field, 3, h, w), wanted.
        share: (3, wavelength), what the lookup will weight them with.
    """
    total = share.sum(0)
    used = (total > 1e-6)[:, None, None]
    scale = torch.where(total > 1e-6, total, 1.0)[:, None, None]
    for _ in range(_MATCH_STEPS):
        seen = torch.einsum("cs,fsij->fcij", share, kernels)
        ratio = torch.where(seen > 1e-15, colours / seen.clamp_min(1e-15), 1.0)
        factor = torch.einsum("cs,fcij->fsij", share, ratio) / scale
        kernels = kernels * torch.where(used, factor, 1.0)
        kernels = kernels / kernels.sum((-2, -1), keepdim=True)
    return kernels


def _centre(kernels: Tensor, side_px: int) -> Tensor:
    cut = (kernels.shape[-1] - side_px) // 2
    return kernels[..., cut : cut + side_px, cut : cut + side_px]

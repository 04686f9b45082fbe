"""What coarse PSF samples and coarse blocks cost, in dB of the Wiener filter alone.

As in use: sharp procedural scenes are blurred by fabricated copies of the lens at several
places, given the noise of the camera at its lowest ISO and at 16 times that, and restored twice:
with the nominal kernel under test, and with the nominal kernel traced at that very place. The
loss is 10 log10 of the ratio of the mean squared errors, averaged over copies, ISOs and places;
these stand for equal areas of the picture.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.bundle.camera import Camera
from camkit.bundle.stages import Wiener
from camkit.contracts import FrozenPsf
from camkit.models_def.optics.frozen import FreezeGrid, corner_height_mm, freeze_at
from camkit.models_def.optics.kernel_bank import focused_copies
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.sensors.psf import color_kernels, kernel_at
from camkit.models_def.sensors.wiener import to_otf, wiener_restore
from camkit.scenes import procedural_scene
from camkit.units import UM_PER_MM

FloatGrid = NDArray[np.float64]

PATCH_PX: Final = 320
MARGIN_PX: Final = 64
PLACES: Final = 8
TRUE_WAVELENGTHS: Final = 13
TRUE_ENERGY: Final = 0.999
TRUE_SIDE_PX: Final = 201
ISO_STEPS: Final = (1.0, 16.0)
OFFSETS: Final = (-0.8, 0.0, 0.8)
BLOCK_HEIGHTS: Final = (0.35, 0.65, 0.9)
PROBE_PX: Final = 64
LARGER_PX: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A loss in dB.

    Attributes:
        mean_db: Over places of equal area.
        worst_db: At the worst place.
    """

    mean_db: float
    worst_db: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """The lens at the places where it is judged.

    Attributes:
        camera: Response, size and noise.
        nominal: The designed lens; its fields are the axis and the places.
        copies: Fabricated copies, focused, the same fields.
        settings: Of the Wiener filter.
        seed: Of scenes and noise.
    """

    camera: Camera
    nominal: FrozenPsf
    copies: tuple[FrozenPsf, ...]
    settings: Wiener
    seed: int

    @property
    def heights_mm(self) -> FloatGrid:
        """Sensor heights (place,) of the places."""
        return self.nominal.field_heights_mm[1:]


def sample_heights(corner_mm: float, places: int) -> FloatGrid:
    """Give heights (place,) in the middle of rings of equal area."""
    return np.asarray(corner_mm * np.sqrt((np.arange(places) + 0.5) / places))


def make_bench(
    lens: Lens,
    camera: Camera,
    settings: Wiener,
    *,
    copies: int = 2,
    rays: int = 4096,
    seed: int = 5,
) -> Bench:
    """Trace a lens and copies of it at the places where it will be judged.

    Args:
        lens: Nominal.
        camera: Response, size and noise.
        settings: Of the Wiener filter.
        copies: How many fabricated copies.
        rays: In half the pupil.
        seed: Of the errors, scenes and noise.
    """
    places = sample_heights(corner_height_mm(camera), PLACES)
    heights = np.concatenate([np.zeros(1), places])
    grid = FreezeGrid(
        wavelengths=TRUE_WAVELENGTHS, energy=TRUE_ENERGY, max_side_px=TRUE_SIDE_PX, rays=rays
    )
    traced = [
        freeze_at(copy, camera, grid, heights).psf
        for copy in focused_copies(lens, copies + 1, seed)
    ]
    return Bench(
        camera=camera, nominal=traced[0], copies=tuple(traced[1:]), settings=settings, seed=seed
    )


def frozen_loss(frozen: FrozenPsf, bench: Bench) -> Loss:
    """Measure what the samples of a frozen PSF cost against one traced where it is used."""
    places = bench.heights_mm
    zero = np.zeros_like(places)
    test, ideal = (_kernels(p, bench.camera, zero, places) for p in (frozen, bench.nominal))
    scenes = _scenes(places.size, PATCH_PX, bench.seed)
    ratios = []
    for copy in bench.copies:
        blurred = _convolve(scenes, _kernels(copy, bench.camera, zero, places))
        for step in ISO_STEPS:
            noisy, shot, read = _noisy(blurred, bench.camera, step, bench.seed)
            wrong, right = (
                _error(wiener_restore(noisy, kernels, shot, read, bench.settings), scenes)
                for kernels in (test, ideal)
            )
            ratios.append(wrong / right)
    return _loss(torch.stack(ratios))


def block_loss(psf: FrozenPsf, bench: Bench, settings: Wiener) -> Loss:
    """Measure what one kernel per block, and the block's own border, cost.

    Blocks at three places of the diagonal are probed at nine points of the area they answer
    for. The other restoration uses the kernel of the probed point and a larger block.

    Args:
        psf: The frozen PSF.
        bench: Camera and a copy that blurs.
        settings: Block and overlap under test.
    """
    half = (settings.block_px - settings.overlap_px) / 2
    camera = bench.camera
    corner_px = np.array([camera.width_px, camera.height_px]) / 2
    places = [
        (share * corner_px, np.array([dx, dy]) * half)
        for share in BLOCK_HEIGHTS
        for dy in OFFSETS
        for dx in OFFSETS
    ]
    pitch_mm = camera.pixel_pitch_um / UM_PER_MM
    centres = np.stack([centre for centre, _ in places]) * pitch_mm
    probed = centres + np.stack([offset for _, offset in places]) * pitch_mm
    blocks, locals_, trues = (
        _kernels(p, camera, at[:, 0], at[:, 1])
        for p, at in ((psf, centres), (psf, probed), (bench.copies[0], probed))
    )
    scene = _scenes(1, settings.block_px + LARGER_PX, bench.seed)
    ratios = [
        _probe(
            (blocks[i : i + 1], locals_[i : i + 1]),
            trues[i : i + 1],
            scene,
            offset,
            (bench, settings),
        )
        for i, (_, offset) in enumerate(places)
    ]
    return _loss(torch.tensor(ratios))


def _probe(
    kernels: tuple[Tensor, Tensor],
    true_kernel: Tensor,
    scene: Tensor,
    offset_px: FloatGrid,
    by: tuple[Bench, Wiener],
) -> float:
    """Give the ratio of squared errors at an offset: with the block's kernel over the local one."""
    bench, settings = by
    block_kernel, local_kernel = kernels
    large = scene.shape[-1]
    noisy, shot, read = _noisy(_convolve(scene, true_kernel), bench.camera, 1.0, bench.seed)
    top, left = (int(large / 2 + o - PROBE_PX / 2) for o in (offset_px[1], offset_px[0]))
    sharp = scene[..., top : top + PROBE_PX, left : left + PROBE_PX]
    errors = []
    for side, kernel in ((settings.block_px, block_kernel), (large, local_kernel)):
        start = (large - side) // 2
        window = slice(start, start + side)
        restored = wiener_restore(noisy[..., window, window], kernel, shot, read, settings)
        rows = slice(top - start, top - start + PROBE_PX)
        columns = slice(left - start, left - start + PROBE_PX)
        errors.append(float((restored[..., rows, columns] - sharp).square().mean()))
    return errors[0] / errors[1]


def _loss(ratios: Tensor) -> Loss:
    each = 10 * torch.log10(ratios)
    return Loss(mean_db=float(each.mean()), worst_db=float(each.max()))


def _error(restored: Tensor, scenes: Tensor) -> Tensor:
    """Give the mean squared error (place,) inside the margin."""
    inside = slice(MARGIN_PX, -MARGIN_PX)
    return (restored - scenes)[..., inside, inside].square().mean(dim=(1, 2, 3))


def _kernels(psf: FrozenPsf, camera: Camera, x_mm: FloatGrid, y_mm: FloatGrid) -> Tensor:
    colours = color_kernels(psf, *camera.channel_response.to_arrays())
    heights = torch.from_numpy(psf.field_heights_mm)
    return kernel_at(colours, heights, torch.from_numpy(x_mm), torch.from_numpy(y_mm))


def _scenes(count: int, size_px: int, seed: int) -> Tensor:
    """Give (count, 3, size, size) scenes below clipping."""
    scenes = [procedural_scene(seed + i, size_px, size_px) for i in range(count)]
    return torch.from_numpy(np.stack(scenes)).clamp(0, 1)


def _convolve(scenes: Tensor, kernels: Tensor) -> Tensor:
    """Blur (b, 3, h, w) with (b, 3, kh, kw), periodic."""
    size = (scenes.shape[-2], scenes.shape[-1])
    blurred: Tensor = torch.fft.irfft2(torch.fft.rfft2(scenes) * to_otf(kernels, size), s=size)
    return blurred


def _noisy(
    pictures: Tensor, camera: Camera, iso_step: float, seed: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Add noise; give pictures, shot (3,), read variance (3,)."""
    noise = camera.noise_at(camera.noise[0].iso * iso_step)
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    variance = pictures.clamp(min=0) * shot[:, None, None] + read[:, None, None]
    grain = torch.randn(pictures.shape, generator=torch.Generator().manual_seed(seed))
    return pictures + variance.sqrt() * grain, shot, read

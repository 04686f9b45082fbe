"""What coarse PSF samples and coarse blocks cost, in dB of the Wiener filter alone.

Sharp procedural scenes are blurred with kernels traced at their own place, given the noise of
the camera's lowest ISO (where errors of the PSF show most), and restored twice: with the kernel
under test and with the true one. The loss is 10 log10 of the ratio of the mean squared errors,
averaged over places that stand for equal areas of the picture.
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
from camkit.models_def.sensors.psf import color_kernels, kernel_at
from camkit.models_def.sensors.wiener import wiener_restore
from camkit.scenes import procedural_scene

FloatGrid = NDArray[np.float64]

PATCH_PX: Final = 320
MARGIN_PX: Final = 64
OFFSETS: Final = (-0.8, 0.0, 0.8)
BLOCK_HEIGHTS: Final = (0.35, 0.65, 0.9)
PROBE_PX: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A loss in dB.

    Attributes:
        mean_db: Over places of equal area.
        worst_db: At the worst place.
    """

    mean_db: float
    worst_db: float


def sample_heights(corner_mm: float, places: int) -> FloatGrid:
    """Give heights (place,) in the middle of rings of equal area."""
    return corner_mm * np.sqrt((np.arange(places) + 0.5) / places)


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
    size = scenes.shape[-2:]
    kh, kw = kernels.shape[-2:]
    padded = torch.nn.functional.pad(kernels, (0, size[1] - kw, 0, size[0] - kh))
    origin = torch.roll(padded, (-(kh // 2), -(kw // 2)), dims=(-2, -1))
    blurred: Tensor = torch.fft.irfft2(torch.fft.rfft2(scenes) * torch.fft.rfft2(origin), s=size)
    return blurred


def _noisy(pictures: Tensor, camera: Camera, seed: int) -> tuple[Tensor, Tensor, Tensor]:
    """Add the noise of the lowest ISO; give pictures, shot (3,), read variance (3,)."""
    noise = camera.noise_at(camera.noise[0].iso)
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    variance = pictures.clamp(min=0) * shot[:, None, None] + read[:, None, None]
    generator = torch.Generator().manual_seed(seed)
    grain = torch.randn(pictures.shape, generator=generator)
    return pictures + variance.sqrt() * grain, shot, read


def _loss(wrong: Tensor, right: Tensor) -> Loss:
    each = 10 * torch.log10(wrong / right)
    return Loss(mean_db=float(each.mean()), worst_db=float(each.max()))


def frozen_loss(
    frozen: FrozenPsf, truth: FrozenPsf, camera: Camera, settings: Wiener, *, seed: int = 5
) -> Loss:
    """Measure what the samples of a frozen PSF cost against a PSF traced where it is used.

    Args:
        frozen: Under test.
        truth: Dense in wavelength, its fields are the places (see `sample_heights`) behind a
            first field on the axis.
        camera: Response and noise.
        settings: Of the Wiener filter.
        seed: Of scenes and noise.
    """
    heights = truth.field_heights_mm[1:]
    zero = np.zeros_like(heights)
    true_kernels = _kernels(truth, camera, zero, heights)
    test_kernels = _kernels(frozen, camera, zero, heights)
    scenes = _scenes(heights.size, PATCH_PX, seed)
    blurred, shot, read = _noisy(_convolve(scenes, true_kernels), camera, seed)
    errors = [
        _crop(wiener_restore(blurred, kernels, shot, read, settings) - scenes)
        for kernels in (test_kernels, true_kernels)
    ]
    wrong, right = (e.square().mean(dim=(1, 2, 3)) for e in errors)
    return _loss(wrong, right)


def _crop(pictures: Tensor) -> Tensor:
    return pictures[..., MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX]


def block_loss(psf: FrozenPsf, camera: Camera, settings: Wiener, *, seed: int = 5) -> Loss:
    """Measure what one kernel per block, and the block's own border, cost.

    Each block at three places of the diagonal is probed at nine points of the area it answers
    for; the other restoration uses the kernel of the probed point and a block with 256 more
    pixels.

    Args:
        psf: The frozen PSF.
        camera: Size, response and noise.
        settings: Block and overlap under test.
        seed: Of scenes and noise.
    """
    pitch_mm = camera.pixel_pitch_um / 1000
    half = (settings.block_px - settings.overlap_px) / 2
    diagonal = np.hypot(camera.width_px, camera.height_px) / 2
    out_x, out_y = camera.width_px / 2 / diagonal, camera.height_px / 2 / diagonal
    wrong: list[float] = []
    right: list[float] = []
    for number, share in enumerate(BLOCK_HEIGHTS):
        centre = np.array([share * diagonal * out_x, share * diagonal * out_y])
        for dy in OFFSETS:
            for dx in OFFSETS:
                offset = np.array([dx * half, dy * half])
                pair = _probe(
                    psf, camera, settings, (centre * pitch_mm, offset, pitch_mm), seed + number
                )
                wrong.append(pair[0])
                right.append(pair[1])
    return _loss(torch.tensor(wrong), torch.tensor(right))


def _probe(
    psf: FrozenPsf,
    camera: Camera,
    settings: Wiener,
    place: tuple[FloatGrid, FloatGrid, float],
    seed: int,
) -> tuple[float, float]:
    """Give the mean squared errors of one block at one offset: its own kernel, and the local one."""
    centre_mm, offset_px, pitch_mm = place
    at_mm = np.stack([centre_mm, centre_mm + offset_px * pitch_mm])
    block_kernel, local_kernel = _kernels(psf, camera, at_mm[:, 0], at_mm[:, 1]).split(1)
    large = settings.block_px + 256
    scene = _scenes(1, large + 2 * MARGIN_PX, seed)
    blurred, shot, read = _noisy(_convolve(scene, local_kernel), camera, seed)
    middle = scene.shape[-1] / 2
    top, left = (int(middle + o - PROBE_PX / 2) for o in (offset_px[1], offset_px[0]))
    errors = []
    for side, kernel in ((settings.block_px, block_kernel), (large, local_kernel)):
        start = int(middle - side / 2)
        window = slice(start, start + side)
        restored = wiener_restore(blurred[..., window, window], kernel, shot, read, settings)
        rows = slice(top - start, top - start + PROBE_PX)
        columns = slice(left - start, left - start + PROBE_PX)
        sharp = scene[..., top : top + PROBE_PX, left : left + PROBE_PX]
        errors.append(float((restored[..., rows, columns] - sharp).square().mean()))
    return errors[0], errors[1]

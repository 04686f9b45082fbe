"""What coarse PSF samples and coarse blocks cost, in dB of the Wiener filter alone.

As in use: sharp procedural scenes are blurred by fabricated copies of the optics at several
places, given the noise of the sensor at its lowest ISO and at 16 times that, and restored twice:
with the nominal kernel under test, and with the nominal kernel traced at that very place. The
loss is 10 log10 of the ratio of the mean squared errors, averaged over copies, ISOs and places;
these stand for equal areas of the picture.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.bundle.sensor import RGB, ColorSensor
from camkit.bundle.stages import Wiener
from camkit.contracts import FrozenPsf
from camkit.models_def.optics.frozen import FreezeGrid, corner_height_mm, freeze_at
from camkit.models_def.optics.optics import FieldLayout, FloatGrid, Optics, radial_layout
from camkit.models_def.sensors.psf import color_kernels
from camkit.models_def.sensors.wiener import to_otf, wiener_restore
from camkit.scenes import procedural_scene
from camkit.units import UM_PER_MM

PATCH_PX: Final = 320
MARGIN_PX: Final = 64
PLACES: Final = 8
TRUE_WAVELENGTHS: Final = 13
TRUE_LOSS: Final = 0.2
LARGER_SIDE_PX: Final = 50
ISO_STEPS: Final = (1.0, 16.0)
OFFSETS: Final = (-0.8, 0.0, 0.8)
BLOCK_HEIGHTS: Final = (0.35, 0.65, 0.9)
PROBE_PX: Final = 64
GOLDEN_ANGLE_RAD: Final = 2.399963
LARGER_PX: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A loss in dB.

    Attributes:
        mean_db: Over places of equal area and the depths.
        worst_db: At the worst place.
        by_depth_db: Over places, for each depth of the bench; empty for `block_loss`.
    """

    mean_db: float
    worst_db: float
    by_depth_db: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """The optics at the places where they are judged.

    Attributes:
        sensor: Response, size and noise.
        nominal: As designed; the fields of radial optics are the axis and the places.
        copies: Fabricated copies, the same fields and depths; the nominal where none is known.
        settings: Of the Wiener filter.
        seed: Of scenes and noise.
        focus_mm: The depth nearest to the focus.
        places_mm: x (place,) and y (place,).
    """

    sensor: ColorSensor
    nominal: FrozenPsf
    copies: tuple[FrozenPsf, ...]
    settings: Wiener
    seed: int
    focus_mm: float
    places_mm: tuple[FloatGrid, FloatGrid]

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """Object distances at which the optics are judged."""
        return tuple(self.nominal.depths_mm.tolist())


def ring_heights(corner_mm: float, places: int) -> FloatGrid:
    """Give heights (place,) in the middle of rings of equal area."""
    return np.asarray(corner_mm * np.sqrt((np.arange(places) + 0.5) / places))


def judged_places(
    optics: Optics, sensor: ColorSensor, fields: int
) -> tuple[FieldLayout, tuple[FloatGrid, FloatGrid]]:
    """Give where to freeze optics densely, and the x (place,) and y (place,) to judge them at.

    Radial optics are judged along +y, and traced there; others all around the axis, from the
    samples that they have.
    """
    corner_mm = corner_height_mm(sensor)
    heights = ring_heights(corner_mm, PLACES)
    layout = optics.layout(corner_mm, fields)
    if layout.symmetry == "radial" and optics.wavelengths_um is None:
        dense = radial_layout(np.concatenate([np.zeros(1), heights]))
        return dense, (np.zeros_like(heights), heights)
    azimuth = GOLDEN_ANGLE_RAD * np.arange(PLACES)
    half_mm = np.array([sensor.width_px, sensor.height_px]) / 2 * sensor.pixel_pitch_um / UM_PER_MM
    x_mm, y_mm = heights * np.cos(azimuth), heights * np.sin(azimuth)
    return layout, (
        np.clip(x_mm, -half_mm[0], half_mm[0]),
        np.clip(y_mm, -half_mm[1], half_mm[1]),
    )


def make_bench(
    optics: Optics,
    sensor: ColorSensor,
    settings: Wiener,
    *,
    copies: int = 2,
    seed: int = 5,
    grid: FreezeGrid | None = None,
) -> Bench:
    """Freeze optics and copies of them densely, where they will be judged.

    Args:
        optics: Nominal.
        sensor: Response, size and noise.
        settings: Of the Wiener filter.
        copies: How many fabricated copies.
        seed: Of the errors, scenes and noise.
        grid: What will be frozen: its depths are taken; kernels are larger here and lose a fifth
            of the light that those to be frozen may lose.
    """
    frozen = grid or FreezeGrid()
    depths = frozen.depths_mm or optics.depths_mm
    fields, places_mm = judged_places(optics, sensor, frozen.fields)
    true_grid = FreezeGrid(
        wavelengths=TRUE_WAVELENGTHS,
        depths_mm=depths,
        energy=1 - TRUE_LOSS * (1 - frozen.energy),
        max_side_px=min(frozen.max_side_px + LARGER_SIDE_PX, PATCH_PX - 1),
    )
    nominal, *fabricated = (
        freeze_at(copy, sensor, true_grid, fields).psf for copy in optics.copies(copies + 1, seed)
    )
    return Bench(
        sensor=sensor,
        nominal=nominal,
        copies=tuple(fabricated) or (nominal,),
        settings=settings,
        seed=seed,
        focus_mm=min(max(optics.focus_mm, depths[0]), depths[-1]),
        places_mm=places_mm,
    )


def frozen_loss(frozen: FrozenPsf, bench: Bench) -> Loss:
    """Measure what the samples of a frozen PSF cost against one traced where it is used.

    The depth is known to both; a frozen PSF without it is interpolated.
    """
    pairs = [
        (_at_places(frozen, bench, depth_mm), _at_places(bench.nominal, bench, depth_mm))
        for depth_mm in bench.depths_mm
    ]
    return _compare(pairs, bench)


def mean_kernel_loss(frozen: FrozenPsf, whole: FrozenPsf, bench: Bench) -> Loss:
    """Measure what the mean kernel over fewer depths costs against that over all of them.

    Light comes from every depth of the bench, which neither is told.

    Args:
        frozen: With the depths under test.
        whole: The same with all depths.
        bench: Optics and copies at all depths.
    """
    pair = _at_places(frozen, bench, None), _at_places(whole, bench, None)
    return _compare([pair] * len(bench.depths_mm), bench)


def _at_places(psf: FrozenPsf, bench: Bench, depth_mm: float | None) -> Tensor:
    """Give the kernels of the places."""
    return _kernels(psf, bench.sensor, bench.places_mm, depth_mm)


def _compare(pairs: list[tuple[Tensor, Tensor]], bench: Bench) -> Loss:
    """Give the loss of the first kernels against the second, a pair for each depth."""
    channels = len(bench.sensor.channels)
    scenes = _scenes(bench.places_mm[0].size, PATCH_PX, bench.seed, channels)
    by_depth = []
    for depth_mm, pair in zip(bench.depths_mm, pairs, strict=True):
        ratios = []
        for copy in bench.copies:
            blurred = _convolve(scenes, _at_places(copy, bench, depth_mm))
            for step in ISO_STEPS:
                noisy, shot, read = _noisy(blurred, bench.sensor, step, bench.seed)
                wrong, right = (
                    _error(wiener_restore(noisy, kernels, shot, read, bench.settings), scenes)
                    for kernels in pair
                )
                ratios.append(wrong / right)
        by_depth.append(torch.stack(ratios))
    loss = _loss(torch.cat(by_depth))
    return replace(loss, by_depth_db=tuple(_loss(ratios).mean_db for ratios in by_depth))


def block_loss(psf: FrozenPsf, bench: Bench, settings: Wiener) -> Loss:
    """Measure what one kernel per block, and the block's own border, cost.

    Blocks at three places of the diagonal are probed at nine points of the area they answer
    for. The other restoration uses the kernel of the probed point and a larger block. The scene
    lies at the focus.

    Args:
        psf: The frozen PSF.
        bench: Sensor and a copy that blurs.
        settings: Block and overlap under test.
    """
    half = (settings.block_px - settings.overlap_px) / 2
    sensor = bench.sensor
    corner_px = np.array([sensor.width_px, sensor.height_px]) / 2
    places = [
        (share * corner_px, np.array([dx, dy]) * half)
        for share in BLOCK_HEIGHTS
        for dy in OFFSETS
        for dx in OFFSETS
    ]
    pitch_mm = sensor.pixel_pitch_um / UM_PER_MM
    centres = np.stack([centre for centre, _ in places]) * pitch_mm
    probed = centres + np.stack([offset for _, offset in places]) * pitch_mm
    blocks, locals_, trues = (
        _kernels(p, sensor, (at[:, 0], at[:, 1]), bench.focus_mm)
        for p, at in ((psf, centres), (psf, probed), (bench.copies[0], probed))
    )
    heights_mm = np.hypot(*centres.T), np.hypot(*probed.T)
    scene = _scenes(1, settings.block_px + LARGER_PX, bench.seed, len(sensor.channels))
    ratios = [
        _probe(
            (
                _Known(kernel=blocks[i : i + 1], height_mm=float(heights_mm[0][i])),
                _Known(kernel=locals_[i : i + 1], height_mm=float(heights_mm[1][i])),
            ),
            trues[i : i + 1],
            scene,
            offset,
            (bench, settings),
        )
        for i, (_, offset) in enumerate(places)
    ]
    return _loss(torch.tensor(ratios))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Known:
    """What a filter is told of its place: kernel (1, c, kh, kw) and field height."""

    kernel: Tensor
    height_mm: float


def _probe(
    known: tuple[_Known, _Known],
    true_kernel: Tensor,
    scene: Tensor,
    offset_px: FloatGrid,
    by: tuple[Bench, Wiener],
) -> float:
    """Give the ratio of squared errors at an offset: as the block knows the place over as it is."""
    bench, settings = by
    large = scene.shape[-1]
    noisy, shot, read = _noisy(_convolve(scene, true_kernel), bench.sensor, 1.0, bench.seed)
    top, left = (int(large / 2 + o - PROBE_PX / 2) for o in (offset_px[1], offset_px[0]))
    sharp = scene[..., top : top + PROBE_PX, left : left + PROBE_PX]
    errors = []
    for side, told in zip((settings.block_px, large), known, strict=True):
        start = (large - side) // 2
        window = slice(start, start + side)
        restored = wiener_restore(
            noisy[..., window, window],
            told.kernel,
            shot,
            read,
            settings,
            height_mm=told.height_mm,
        )
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


def _kernels(
    psf: FrozenPsf,
    sensor: ColorSensor,
    at_mm: tuple[FloatGrid, FloatGrid],
    depth_mm: float | None,
) -> Tensor:
    fields = color_kernels(psf, *sensor.response_arrays(), depth_mm=depth_mm)
    x_mm, y_mm = (torch.from_numpy(values) for values in at_mm)
    return fields.at(x_mm, y_mm)


def _scenes(count: int, size_px: int, seed: int, channels: int) -> Tensor:
    """Give (count, c, size, size) scenes below clipping; grey ones unless there are three."""
    scenes = [procedural_scene(seed + i, size_px, size_px) for i in range(count)]
    pictures = torch.from_numpy(np.stack(scenes)).clamp(0, 1)
    if channels == len(RGB):
        return pictures
    return pictures.mean(1, keepdim=True).expand(-1, channels, -1, -1)


def _convolve(scenes: Tensor, kernels: Tensor) -> Tensor:
    """Blur (b, c, h, w) with (b, c, kh, kw), periodic."""
    size = (scenes.shape[-2], scenes.shape[-1])
    blurred: Tensor = torch.fft.irfft2(torch.fft.rfft2(scenes) * to_otf(kernels, size), s=size)
    return blurred


def _noisy(
    pictures: Tensor, sensor: ColorSensor, iso_step: float, seed: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Add noise; give pictures, shot (c,), read variance (c,)."""
    noise = sensor.noise_at(sensor.noise[0].iso * iso_step)
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    variance = pictures.clamp(min=0) * shot[:, None, None] + read[:, None, None]
    grain = torch.randn(pictures.shape, generator=torch.Generator().manual_seed(seed))
    return pictures + variance.sqrt() * grain, shot, read

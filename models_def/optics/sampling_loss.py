"""The cost of coarse PSF samples and coarse blocks, in dB of the Wiener filter alone.

As in use: sharp procedural scenes are blurred by fabricated copies of the optics at several
places, given the noise of the sensor at its lowest ISO and at 16 times that, and restored twice:
with the nominal kernel under test, and with the nominal kernel traced at that very place. The
loss is 10 log10 of the ratio of the mean squared errors, averaged over copies, ISOs and places;
each place stands for an equal area of the picture.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.bundle.sensor import RGB, ColorSensor
from camkit.bundle.stages import Wiener
from camkit.models_def.optics.freezable_optics import FieldLayout, FloatGrid, Optics, radial_layout
from camkit.models_def.optics.frozen import FreezeGrid, corner_height_mm, freeze_at
from camkit.models_def.sensors.wiener import to_otf, wiener_restore
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import color_kernels
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
PROBE_SCENES: Final = 3
REFERENCE_PX: Final = 640


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
    """Return heights (place,) in the middle of rings of equal area."""
    return np.asarray(corner_mm * np.sqrt((np.arange(places) + 0.5) / places))


def judged_places(
    optics: Optics, sensor: ColorSensor, fields: int
) -> tuple[FieldLayout, tuple[FloatGrid, FloatGrid]]:
    """Return a dense grid of optics, and the x (place,) and y (place,) that are judged.

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
        least_energy=frozen.energy if frozen.least_energy is None else frozen.least_energy,
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
    """Return the kernels of the places."""
    return _kernels(psf, bench.sensor, bench.places_mm, depth_mm)


def _compare(pairs: list[tuple[Tensor, Tensor]], bench: Bench) -> Loss:
    """Return the loss of the first kernels against the second, a pair for each depth."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Probe:
    """A place where blocks are judged: a scene through a copy, and what can be had there.

    Attributes:
        noisy: (1, c, s, s), the place in its middle.
        sharp: (1, c, PROBE_PX, PROBE_PX) of the middle.
        at_mm: x and y of the place.
        shot: (c,) of the noise.
        read_variance: (c,) of the noise.
        error: Mean squared error with the kernel of the place itself, in a block of REFERENCE_PX.
    """

    noisy: Tensor
    sharp: Tensor
    at_mm: FloatGrid
    shot: Tensor
    read_variance: Tensor
    error: float


def make_probes(psf: FrozenPsf, bench: Bench, grids: Sequence[Wiener]) -> tuple[Probe, ...]:
    """Photograph the places where block grids are judged, the same for all of them.

    Three places of the diagonal, each with several scenes, at the focus.

    Args:
        psf: The frozen PSF.
        bench: Sensor, a copy that blurs, and the filter.
        grids: Blocks and overlaps that will be judged.
    """
    sensor = bench.sensor
    side_px = max(REFERENCE_PX, *(_reach_px(grid) for grid in grids))
    half_mm = np.array([sensor.width_px, sensor.height_px]) / 2 * _pitch_mm(sensor)
    places = np.stack([share * half_mm for share in BLOCK_HEIGHTS])
    at = places[:, 0], places[:, 1]
    kernels, trues = (_kernels(p, sensor, at, bench.focus_mm) for p in (psf, bench.copies[0]))
    scenes = _scenes(PROBE_SCENES, side_px, bench.seed, len(sensor.channels))
    probes = []
    for i, at_mm in enumerate(places):
        for scene in scenes[:, None]:
            blurred = _convolve(scene, trues[i : i + 1])
            noisy, shot, read = _noisy(blurred, sensor, 1.0, bench.seed)
            sharp = _middle(scene, PROBE_PX)
            probe = Probe(
                noisy=noisy, sharp=sharp, at_mm=at_mm, shot=shot, read_variance=read, error=0.0
            )
            middle = kernels[i : i + 1], at_mm
            error = _block_error(probe, middle, np.zeros(2), REFERENCE_PX, bench.settings)
            probes.append(replace(probe, error=error))
    return tuple(probes)


def block_loss(
    psf: FrozenPsf, bench: Bench, settings: Wiener, probes: Sequence[Probe] = ()
) -> Loss:
    """Measure what one kernel per block, and the block's own border, cost.

    Every probe is seen from blocks that lie off it by nine offsets within the area that a block
    answers for, each with the kernel of its own middle.

    Args:
        psf: The frozen PSF.
        bench: Sensor and filter.
        settings: Block and overlap under test.
        probes: Of `make_probes`; made here if there are none.
    """
    half = (settings.block_px - settings.overlap_px) / 2
    offsets = [np.array([dx, dy]) * half for dy in OFFSETS for dx in OFFSETS]
    pitch_mm = _pitch_mm(bench.sensor)
    ratios = []
    for probe in probes or make_probes(psf, bench, [settings]):
        middles = np.stack([probe.at_mm - offset * pitch_mm for offset in offsets])
        at = middles[:, 0], middles[:, 1]
        kernels = _kernels(psf, bench.sensor, at, bench.focus_mm)
        errors = [
            _block_error(probe, (kernels[i : i + 1], at_mm), offset, settings.block_px, settings)
            for i, (at_mm, offset) in enumerate(zip(middles, offsets, strict=True))
        ]
        ratios += [error / probe.error for error in errors]
    return _loss(torch.tensor(ratios))


def _block_error(
    probe: Probe,
    middle: tuple[Tensor, FloatGrid],
    offset_px: FloatGrid,
    block_px: int,
    settings: Wiener,
) -> float:
    """Return the mean squared error of a probe in a block that it lies off the middle of.

    Args:
        probe: With its scene.
        middle: Kernel (1, c, kh, kw) and place of the block's middle.
        offset_px: (x, y) of the probe from the block's middle.
        block_px: Side of the block.
        settings: Of the filter.
    """
    kernel, at_mm = middle
    side = probe.noisy.shape[-1]
    left, top = (round((side - block_px) / 2 - float(offset)) for offset in offset_px)
    restored = wiener_restore(
        probe.noisy[..., top : top + block_px, left : left + block_px],
        kernel,
        probe.shot,
        probe.read_variance,
        settings,
        height_mm=float(np.hypot(*at_mm)),
    )
    first = (side - PROBE_PX) // 2
    rows, columns = (slice(first - a, first - a + PROBE_PX) for a in (top, left))
    return float((restored[..., rows, columns] - probe.sharp).square().mean())


def _reach_px(grid: Wiener) -> int:
    """Return the side of a scene that holds all blocks of a grid that see its middle."""
    offset_px = max(OFFSETS) * (grid.block_px - grid.overlap_px)
    return 2 * int(np.ceil((grid.block_px + offset_px) / 2)) + 2


def _middle(planes: Tensor, size_px: int) -> Tensor:
    first = (planes.shape[-1] - size_px) // 2
    return planes[..., first : first + size_px, first : first + size_px]


def _pitch_mm(sensor: ColorSensor) -> float:
    return sensor.pixel_pitch_um / UM_PER_MM


def _loss(ratios: Tensor) -> Loss:
    each = 10 * torch.log10(ratios)
    return Loss(mean_db=float(each.mean()), worst_db=float(each.max()))


def _error(restored: Tensor, scenes: Tensor) -> Tensor:
    """Return the mean squared error (place,) inside the margin."""
    inside = slice(MARGIN_PX, -MARGIN_PX)
    return (restored - scenes)[..., inside, inside].square().mean(dim=(1, 2, 3))


def _kernels(
    psf: FrozenPsf,
    sensor: ColorSensor,
    at_mm: tuple[FloatGrid, FloatGrid],
    depth_mm: float | None,
) -> Tensor:
    fields = color_kernels(psf, *sensor.response_arrays(), depth_mm=depth_mm)
    places = zip(*(values.tolist() for values in at_mm), strict=True)
    return torch.from_numpy(np.stack([fields.at(x_mm, y_mm) for x_mm, y_mm in places]))


def _scenes(count: int, size_px: int, seed: int, channels: int) -> Tensor:
    """Return (count, c, size, size) scenes below clipping; grey ones unless there are three."""
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
    """Add noise; return pictures, shot (c,), read variance (c,)."""
    noise = sensor.noise_at(sensor.noise[0].iso * iso_step)
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    variance = pictures.clamp(min=0) * shot[:, None, None] + read[:, None, None]
    grain = torch.randn(pictures.shape, generator=torch.Generator().manual_seed(seed))
    return pictures + variance.sqrt() * grain, shot, read

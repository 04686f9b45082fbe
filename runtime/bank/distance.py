"""The distance of the scene, found in the capture: that whose kernels explain it.

    capture in cells -> blocks -> spectra --+-> how probable, by distance --> with the neighbours
    kernels of every depth, in cells -------+                                     |
                                                        nearness (rows, columns), 1 / distance

A block's cells are taken for light that all colours share, of a power that falls with frequency,
and a little light of each colour's own, seen through the kernels of one distance:

    Y_c = a_c H_c (x + e_c) + n_c,   power of x: s F,   of e_c: OWN s F
    F = (f^2 + f0^2)^(-EXPONENT / 2), scaled to 1 at POWER_AT

and what kernels cannot promise has the power MISTRUST s F. A lens blurs its colours differently at
every distance, in size and in place, so colours that share their light tell the distance, even
where no edge is sharp. Y is Gaussian and its covariance a diagonal one plus one of rank one, so
its probability has a closed form. The power s is the likeliest of a few.

Probabilities of neighbouring blocks are multiplied, since most scenes are smooth in depth, and
tempered, since no scene is Gaussian. What is given is the mean of 1 / distance, in which defocus
is linear.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import CfaPattern, FloatArray, NoiseModel, cfa_channels
from camkit.runtime.bank.blocks import to_otf
from camkit.runtime.bank.psf import FieldKernels, FloatGrid
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.units import MM_PER_M

CELL_PX: Final = 4
BLOCK_CELLS: Final = 96
BAND: Final = (0.01, 0.12)
"""Cycles per pixel that are looked at: above, the samples of a mosaic alias in cells."""
EVERY: Final = 3
"""One in so many frequencies: the window of a block blurs its spectrum anyway."""
CORNER_FREQUENCY: Final = 1 / 512
EXPONENT: Final = 2.7
OWN: Final = 2.0
MISTRUST: Final = 0.002
POWERS: Final = tuple(10.0 ** (np.arange(9) * 0.67 - 5))
"""Powers s at a frequency of `POWER_AT`, over the squared level."""
POWER_AT: Final = 0.03
STEPS: Final = 17
"""Distances that are tried, evenly in 1 / distance."""
KEPT_STEPS: Final = 4
"""Steps whose kernels are kept, since neighbouring blocks share them."""
TEMPER: Final = 0.02
NEIGHBOURS: Final = (1.0, 1.0, 1.0)
"""Weights of the blocks beside a block, along rows and columns."""
EVERYWHERE: Final = 0.1
"""Weight of the mean of all blocks: it decides where neither a block nor its neighbours tell."""
CLIPPED_SHARE: Final = 0.005
"""A block with more clipped cells is not asked."""
DARK: Final = 1e-6
LEAST_NEARNESS: Final = 1e-9
"""In 1/mm; scenes that are farther count as 1000 km away."""

Complex = NDArray[np.complex64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class NearnessMap:
    """The nearness of the scene, over a capture.

    Attributes:
        values: (rows, columns), 1 / distance in 1/mm.
        first_px: Where the first lies, along rows and columns.
        step_px: How far neighbours are apart, likewise.
    """

    values: FloatGrid
    first_px: tuple[float, float]
    step_px: tuple[float, float]

    def at(self, x_px: float, y_px: float) -> float:
        """Return 1 / distance in 1/mm of a pixel position; linear between places."""
        where = [
            [(at - first) / step]
            for at, first, step in zip((y_px, x_px), self.first_px, self.step_px, strict=True)
        ]
        found = scipy.ndimage.map_coordinates(self.values, where, order=1, mode="nearest")
        return float(found[0])

    def to_json(self) -> dict[str, float]:
        """Return the distances in m that a sidecar keeps: nearest, usual and farthest."""
        far, middle, near = np.quantile(self.values, (0, 0.5, 1))
        return {
            name: float(1 / max(nearness, LEAST_NEARNESS)) / MM_PER_M
            for name, nearness in (("nearest_m", near), ("median_m", middle), ("farthest_m", far))
        }


class KernelsByDistance:
    """The kernels of a camera at as many distances as are told apart.

    Kernels are linear in 1 / distance between the depths that are known, as
    `camkit.contracts.depth_weights` has them.
    """

    def __init__(self, depths_mm: FloatGrid, kernels: Sequence[FieldKernels]) -> None:
        """Take what is known.

        Args:
            depths_mm: (depth,), increasing; inf is allowed.
            kernels: Of every depth, of one shape.
        """
        known = 1 / np.asarray(depths_mm, np.float64)
        self.nearness: FloatGrid = np.linspace(known[-1], known[0], STEPS)
        hats = [np.interp(self.nearness, known[::-1], unit) for unit in np.eye(known.size)[::-1]]
        self.weights: FloatGrid = np.stack(hats, axis=1)
        """(step, depth): the share of every depth in the kernels of a step."""
        self._kernels = tuple(kernels)
        self.of = lru_cache(maxsize=KEPT_STEPS)(self._of)
        """Cached: the `FieldKernels` of a step."""

    def step_of(self, nearness: float) -> int:
        """Return the step nearest to 1 / distance in 1/mm."""
        return int(np.abs(self.nearness - nearness).argmin())

    def over(self, scene: NearnessMap) -> "KernelsOfScene":
        """Return the kernels of the places of a capture, for a bank."""
        return KernelsOfScene(kernels=self, scene=scene)

    def in_cells(self) -> tuple[FieldKernels, ...]:
        """Return the kernels of every depth as seen in cells."""
        return tuple(replace(k, kernels=_in_cells(k.kernels)) for k in self._kernels)

    def _of(self, step: int) -> FieldKernels:
        used = [(w, k) for w, k in zip(self.weights[step], self._kernels, strict=True) if w > 0]
        if len(used) == 1:
            return used[0][1]
        mixed = sum(np.float32(weight) * kernels.kernels for weight, kernels in used)
        return replace(used[0][1], kernels=np.asarray(mixed, np.float32))


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelsOfScene:
    """The kernels of a scene; a `camkit.runtime.bank.blocks.KernelChoice`."""

    kernels: KernelsByDistance
    scene: NearnessMap

    def number_at(self, x_px: float, y_px: float) -> int:
        """Return the step of the distance at a pixel position of the capture."""
        return self.kernels.step_of(self.scene.at(x_px, y_px))

    def kernels_of(self, number: int) -> FieldKernels:
        """Return the kernels of a step."""
        return self.kernels.of(number)


def find_nearness(
    cells: FloatArray,
    clipped: Mask,
    kernels: KernelsByDistance,
    window: SensorWindow,
    *,
    noise: NoiseModel,
    cfa: CfaPattern | None,
    threads: int = 1,
) -> NearnessMap:
    """Compute how near the scene is.

    Args:
        cells: (c, rows, columns) of `camkit.runtime.bank.cell_means.cell_means`, `CELL_PX` wide.
        clipped: The same shape; where a sample clipped.
        kernels: Of the camera.
        window: Place of the capture on the sensor.
        noise: Of one sample, of the scale of the cells.
        cfa: Of the mosaic that the cells are of; None for planes.
        threads: Blocks looked at at a time; no influence on what is found.

    Returns:
        Where nothing tells the distance, the middle of what is known.
    """
    spectrum = _spectrum(cfa, len(cells))
    coarse = kernels.in_cells()
    rows, columns = (_laid(side) for side in cells.shape[1:])

    def look(place: tuple[int, int]) -> FloatGrid:
        top, left = place
        part = np.s_[:, top : top + BLOCK_CELLS, left : left + BLOCK_CELLS]
        if clipped[part].any(axis=0).mean() > CLIPPED_SHARE:
            return np.zeros(STEPS)
        at_mm = window.to_mm(*(CELL_PX * (at + BLOCK_CELLS / 2) - 0.5 for at in (left, top)))
        transfers = [to_otf(k.at(*map(float, at_mm)), BLOCK_CELLS) for k in coarse]
        otf = spectrum.of(np.stack(transfers))
        return _likelihoods(_filled(cells[part]), otf, kernels.weights, spectrum, noise)

    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(look, ((top, left) for top in rows for left in columns)))
    likely = np.array(found).reshape(len(rows), len(columns), STEPS)
    everywhere = EVERYWHERE * likely.mean(axis=(0, 1))
    for axis in (0, 1):
        likely = scipy.ndimage.convolve1d(likely, NEIGHBOURS, axis=axis, mode="constant")
    likely += everywhere
    odds = np.exp(TEMPER * (likely - likely.max(axis=-1, keepdims=True)))
    values = (odds * kernels.nearness).sum(axis=-1) / odds.sum(axis=-1)
    middles = [CELL_PX * (starts[0] + BLOCK_CELLS / 2) - 0.5 for starts in (rows, columns)]
    steps = [CELL_PX * float(s[-1] - s[0]) / max(len(s) - 1, 1) or 1.0 for s in (rows, columns)]
    return NearnessMap(
        values=values, first_px=(middles[0], middles[1]), step_px=(steps[0], steps[1])
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spectrum:
    """The frequencies of a block of cells that are looked at.

    Attributes:
        places: (n,) in the flattened half plane.
        weight: (n,) 2 where a frequency stands for its mirror image too.
        fall: (n,) F, 1 at `POWER_AT`.
        moved: (c, n) what the places of a colour's samples in a cell do to its phase.
        samples: (c, 1) of every colour in a cell.
    """

    places: NDArray[np.intp]
    weight: FloatArray
    fall: FloatArray
    moved: Complex
    samples: FloatArray

    def of(self, planes: Complex) -> Complex:
        """Take these frequencies of (..., c, b, b // 2 + 1) transfers, phases included."""
        flat = planes.reshape(*planes.shape[:-2], -1)
        return np.asarray(flat[..., self.places] * self.moved)


@lru_cache(maxsize=4)
def _spectrum(cfa: CfaPattern | None, channels: int) -> _Spectrum:
    fy, fx = np.meshgrid(
        np.fft.fftfreq(BLOCK_CELLS) / CELL_PX, np.fft.rfftfreq(BLOCK_CELLS) / CELL_PX, indexing="ij"
    )
    f2 = fy * fy + fx * fx
    inside = (f2 > BAND[0] ** 2) & (f2 < BAND[1] ** 2)
    places = np.flatnonzero(inside)[::EVERY]
    fy, fx, f2 = (plane.ravel()[places] for plane in (fy, fx, f2))
    corner = CORNER_FREQUENCY**2
    offsets, samples = np.zeros((channels, 2)), np.full((channels, 1), float(CELL_PX**2))
    if cfa is not None:
        colours = np.array(cfa_channels(cfa))
        for channel in range(channels):
            sites = np.argwhere(colours == channel)
            offsets[channel] = sites.mean(axis=0) - 0.5
            samples[channel] = len(sites) * (CELL_PX // 2) ** 2
    turns = offsets[:, :1] * fy + offsets[:, 1:] * fx
    return _Spectrum(
        places=places,
        weight=np.where(fx == 0, 1, 2).astype(np.float32),
        fall=(((f2 + corner) / (POWER_AT**2 + corner)) ** (-EXPONENT / 2)).astype(np.float32),
        # a sample that lies further on sees the scene earlier
        moved=np.exp(2j * np.pi * turns).astype(np.complex64),
        samples=samples.astype(np.float32),
    )


@lru_cache(maxsize=1)
def _block_window() -> FloatArray:
    """Return (b, b): Hann's window, of unit mean square."""
    line = np.hanning(BLOCK_CELLS + 2)[1:-1]
    window = line[:, None] * line
    return np.asarray(window / np.sqrt(np.square(window).mean()), np.float32)


def _laid(cells: int) -> NDArray[np.intp]:
    """Return where the blocks begin along a side, evenly; the last ends where the cells end."""
    last = max(cells - BLOCK_CELLS, 0)
    return np.linspace(0, last, 1 + -(-last // BLOCK_CELLS)).round().astype(np.intp)


def _filled(block: FloatArray) -> FloatArray:
    """Return a block of full size, mirrored where the capture ends."""
    missing = [max(BLOCK_CELLS - side, 0) for side in block.shape[1:]]
    if not any(missing):
        return block
    return np.pad(block, ((0, 0), (0, missing[0]), (0, missing[1])), mode="symmetric")


def _likelihoods(
    block: FloatArray, otf: Complex, weights: FloatGrid, spectrum: _Spectrum, noise: NoiseModel
) -> FloatGrid:
    """Return the logarithm of the probability of a block at every step, up to a constant.

    Args:
        block: (c, b, b) cells.
        otf: (depth, c, n) of the depths that are known.
        weights: (step, depth).
        spectrum: The frequencies.
        noise: Of one sample.
    """
    level = np.maximum(block.mean(axis=(1, 2), keepdims=True, dtype=np.float64), DARK)
    variance = np.array(noise.shot) * level.ravel() + np.array(noise.read_variance)
    variance = variance[:, None] / (spectrum.samples * np.square(level[..., 0]))
    whole = np.fft.rfft2((block / level - 1) * _block_window()).reshape(len(block), -1)
    seen = (whole[:, spectrum.places] / BLOCK_CELLS).astype(np.complex64)
    transfer = np.tensordot(weights.astype(np.float32), otf, axes=1)
    power = np.square(transfer.real) + np.square(transfer.imag)
    crossed = transfer.conj() * seen
    squared = np.square(seen.real) + np.square(seen.imag)
    best = np.full(len(weights), -np.inf)
    for scale in POWERS:
        fall = np.float32(scale) * spectrum.fall
        alone = (OWN * power + np.float32(MISTRUST)) * fall + variance.astype(np.float32)
        inverse = 1 / alone
        shared = 1 + (power * inverse).sum(axis=1) * fall
        joint = (crossed * inverse).sum(axis=1)
        misfit = (squared * inverse).sum(axis=1)
        misfit -= (np.square(joint.real) + np.square(joint.imag)) * fall / shared
        misfit += np.log(alone).sum(axis=1) + np.log(shared)
        best = np.maximum(best, -(misfit @ spectrum.weight).astype(np.float64))
    return np.asarray(best - best.max())


def _in_cells(kernels: FloatArray) -> FloatArray:
    """Return (field, c, h, w) kernels in cells about their centre; each sums to 1."""
    down, across = (_gathering(side) for side in kernels.shape[-2:])
    cells = down @ kernels @ across.T
    return np.asarray(cells / cells.sum(axis=(-2, -1), keepdims=True), np.float32)


def _gathering(side_px: int) -> FloatArray:
    """Return (cells, pixels): the share of every pixel that falls into every cell of a block."""
    reach_px = side_px // 2
    reach = min((reach_px + CELL_PX // 2) // CELL_PX + 1, (BLOCK_CELLS - 1) // 2)
    pixels = np.arange(-reach_px, side_px - reach_px)
    edges = CELL_PX * (np.arange(-reach, reach + 1)[:, None] + np.array([-0.5, 0.5]))
    low = np.maximum(pixels - 0.5, edges[:, :1])
    high = np.minimum(pixels + 0.5, edges[:, 1:])
    return np.asarray(np.clip(high - low, 0, 1), np.float32)

"""The distance of the scene, found in the capture: that whose kernels explain it.

    capture in cells -> blocks -> spectra --+-> how probable, by distance --> with the neighbours
    kernels of every depth, in cells -------+                                     |
                                                        nearness (rows, columns), 1 / distance

A block's cells are taken for light that all colours share, of a power that falls with frequency,
and a little light of each colour's own, seen through the kernels of one distance:

    Y_c = a_c H_c (x + e_c) + n_c,   power of x: s F,   of e_c: COLOUR_POWER s F
    F = (f^2 + f0^2)^(-EXPONENT / 2), scaled to 1 at POWER_AT

and what kernels cannot promise has the power MISTRUST s F. A lens blurs its colours differently at
every distance, in size and in place, so colours that share their light tell the distance, even
where no edge is sharp. The covariance of Y is a diagonal one plus one of rank one, so its
probability has a closed form. It is that of Student's distribution: a scene has frequencies that no
single s foresees, and kernels have zeros where another lens of the series has none; behind
Gaussian light a few such frequencies outvoted all others. The power s is the likeliest of a few.

Probabilities of neighbouring blocks are multiplied, since most scenes are smooth in depth, and
tempered, since neighbouring frequencies are no witnesses of their own. Those of neighbouring steps
are multiplied too: kernels between known depths are mixtures, whose zeros are filled, so they err
less than kernels of a single depth where both are wrong. The result is the mean of 1 / distance, in
which defocus is linear; NaN where the odds are even.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import to_otf
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.bank.kernels_by_distance import KernelsByDistance, NearnessMap
from camkit.runtime.bank.psf import FieldKernels, FloatGrid
from camkit.runtime.geometry.sensor_window import SensorWindow

CELL_PX: Final = 4
BLOCK_CELLS: Final = 96
BAND: Final = (0.01, 0.12)
"""Cycles per pixel that are looked at: above, the samples of a mosaic alias in cells."""
EVERY: Final = 3
"""One in so many frequencies: the window of a block blurs its spectrum anyway."""
CORNER_FREQUENCY: Final = 1 / 512
EXPONENT: Final = 2.7
COLOUR_POWER: Final = 15.0
MISTRUST: Final = 0.002
FREEDOM: Final = 1.0
"""Degrees of freedom of Student's distribution."""
POWERS: Final = tuple(10.0 ** (np.arange(9) * 0.67 - 5))
"""Powers s at a frequency of `POWER_AT`, over the squared level."""
POWER_AT: Final = 0.03
TEMPER: Final = 0.06
STEP_WEIGHTS: Final = (0.25, 0.5, 0.25)
"""Weights of the steps beside a step: every other one may be of a known depth."""
EVEN_ODDS: Final = 0.5
"""Spread over the steps, in that of even odds, from which on nothing tells the distance."""
NEIGHBOURS: Final = (1.0, 1.0, 1.0)
"""Weights of the blocks beside a block, along rows and columns."""
EVERYWHERE: Final = 0.1
"""Weight of the mean of all blocks: it decides where neither a block nor its neighbours tell."""
CLIPPED_SHARE: Final = 0.5
"""A block with more clipped cells is not asked; with fewer, its halos and the rest still tell."""
DARK: Final = 1e-6

Complex = NDArray[np.complex64]
Mask = NDArray[np.bool_]


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
        NaN where nothing tells the distance.
    """
    spectrum = _spectrum(cfa, len(cells))
    coarse = _coarse(kernels)
    rows, columns = (_block_starts(side) for side in cells.shape[1:])

    def look(place: tuple[int, int]) -> FloatGrid:
        top, left = place
        part = np.s_[:, top : top + BLOCK_CELLS, left : left + BLOCK_CELLS]
        if clipped[part].any(axis=0).mean() > CLIPPED_SHARE:
            return np.zeros(kernels.nearness.size)
        at_mm = window.to_mm(*(CELL_PX * (at + BLOCK_CELLS / 2) - 0.5 for at in (left, top)))
        transfers = [to_otf(k.at(*map(float, at_mm)), BLOCK_CELLS) for k in coarse]
        otf = spectrum.of(np.stack(transfers))
        return _likelihoods(_filled(cells[part]), otf, kernels.weights, spectrum, noise)

    with ThreadPoolExecutor(threads) as pool:
        likelihoods = list(pool.map(look, ((top, left) for top in rows for left in columns)))
    likely = np.array(likelihoods).reshape(len(rows), len(columns), kernels.nearness.size)
    middles = [CELL_PX * (starts[0] + BLOCK_CELLS / 2) - 0.5 for starts in (rows, columns)]
    steps = [CELL_PX * float(s[-1] - s[0]) / max(len(s) - 1, 1) or 1.0 for s in (rows, columns)]
    return NearnessMap(
        values=_means(likely, kernels.nearness),
        first_px=(middles[0], middles[1]),
        step_px=(steps[0], steps[1]),
    )


def search_blocks(size_px: tuple[int, int]) -> int:
    """Return the number of blocks of a capture of (height, width) that are searched."""
    rows, columns = (len(_block_starts(cell_count(side, CELL_PX))) for side in size_px)
    return rows * columns


def _means(likely: FloatGrid, nearness: FloatGrid) -> FloatGrid:
    """Return (rows, columns): the mean nearness of every block; NaN where the odds are even.

    Args:
        likely: (rows, columns, step) logarithms of probabilities, of every block alone.
        nearness: (step,).
    """
    import scipy.ndimage  # late: cameras of one distance need none of it

    everywhere = EVERYWHERE * likely.mean(axis=(0, 1))
    for axis in (0, 1):
        likely = scipy.ndimage.convolve1d(likely, NEIGHBOURS, axis=axis, mode="constant")
    likely = scipy.ndimage.convolve1d(likely + everywhere, STEP_WEIGHTS, axis=-1, mode="nearest")
    odds = np.exp(TEMPER * (likely - likely.max(axis=-1, keepdims=True)))
    odds /= odds.sum(axis=-1, keepdims=True)
    means = odds @ nearness
    spread = np.sqrt((odds * np.square(nearness - means[..., None])).sum(axis=-1))
    return np.where(spread < EVEN_ODDS * nearness.std(), means, np.nan)


@lru_cache(maxsize=1)
def _coarse(kernels: KernelsByDistance) -> tuple[FieldKernels, ...]:
    """Return the kernels of every depth as seen in cells; kept for the next capture."""
    return tuple(replace(k, kernels=_in_cells(k.kernels)) for k in kernels.depth_kernels)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spectrum:
    """The frequencies of a block of cells that are looked at.

    Attributes:
        places: (n,) in the flattened half plane.
        weight: (n,) 2 where a frequency stands for its mirror image too.
        fall: (n,) F, 1 at `POWER_AT`.
        phases: (c, n) what the places of a colour's samples in a cell do to its phase.
        samples: (c, 1) of every colour in a cell.
    """

    places: NDArray[np.intp]
    weight: FloatArray
    fall: FloatArray
    phases: Complex
    samples: FloatArray

    def of(self, planes: Complex) -> Complex:
        """Select these frequencies of (..., c, b, b // 2 + 1) transfers, phases included."""
        flat = planes.reshape(*planes.shape[:-2], -1)
        return np.asarray(flat[..., self.places] * self.phases)


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
        phases=np.exp(2j * np.pi * turns).astype(np.complex64),
        samples=samples.astype(np.float32),
    )


@lru_cache(maxsize=1)
def _block_window() -> FloatArray:
    """Return (b, b): Hann's window, of unit mean square."""
    line = np.hanning(BLOCK_CELLS + 2)[1:-1]
    window = line[:, None] * line
    return np.asarray(window / np.sqrt(np.square(window).mean()), np.float32)


def _block_starts(cells: int) -> NDArray[np.intp]:
    """Return the first cells of blocks along a side, evenly; the last block ends with the cells."""
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
    coefficients = (whole[:, spectrum.places] / BLOCK_CELLS).astype(np.complex64)
    transfer = np.tensordot(weights.astype(np.float32), otf, axes=1)
    power = np.square(transfer.real) + np.square(transfer.imag)
    crossed = transfer.conj() * coefficients
    squared = np.square(coefficients.real) + np.square(coefficients.imag)
    best = np.full(len(weights), -np.inf)
    for scale in POWERS:
        fall = np.float32(scale) * spectrum.fall
        alone = (COLOUR_POWER * power + np.float32(MISTRUST)) * fall + variance.astype(np.float32)
        inverse = 1 / alone
        shared = 1 + (power * inverse).sum(axis=1) * fall
        joint = (crossed * inverse).sum(axis=1)
        misfit = (squared * inverse).sum(axis=1)
        misfit -= (np.square(joint.real) + np.square(joint.imag)) * fall / shared
        misfit = (FREEDOM + len(block)) * np.log1p(misfit / FREEDOM)
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

"""The noise of a capture that states none, and the repair of its broken samples.

    blocks of one colour -> level, robust variance of a high-pass -> variance = shot x + read

A sample is broken when it is NaN or inf, or when it alone stands far outside all its same-colour
neighbours while the other colours around it show nothing: light reaches a sensor through a lens,
whose blur no single sample escapes.
"""

import logging
from collections.abc import Iterator
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.signal.glow import MARGIN_PX, OUTLIER_SPREADS, glows, neighbours

BoolArray = NDArray[np.bool_]

REPAIR_MARGIN_PX: Final = MARGIN_PX
"""Rows of context that a band needs above and below for the same repair as the whole."""

_OUTLIER_LEAST: Final = 0.02
_CACHED_ROWS: Final = 16
"""Rows looked at together: what is made of them stays in cache."""

_BLOCK: Final = 16
_BAND_ROWS: Final = 64
_MAX_BANDS: Final = 64
_LEVELS: Final = 12
_LEAST_BLOCKS: Final = 8
_MAD_TO_SIGMA: Final = 1.4826
_HIGH_PASS_POWER: Final = 36.0
_FLAT_QUANTILE: Final = 0.3
_FLAT_QUANTILE_OF_NOISE: Final = 0.892
"""What the quantile gives for white noise of variance one (measured on 4 million samples)."""

_SHOT: Final = (1e-6, 0.1)
"""White levels of a million electrons (many frames added) down to 10."""
_READ_E: Final = (0.3, 100.0)
"""Read noise in electrons, of the quietest sensors up to those of cheap or old cameras."""
_USUAL_READ_E: Final = 3.0
_USUAL_FACTOR: Final = 4.0
"""One standard deviation of what read noise usually is. It decides where the levels of a capture do
not: a wall, a sky or a dark frame shows the sum of both noises and not their shares."""
_SPREAD_OF_VARIANCE: Final = 0.03
_SPREAD_OF_BLOCK: Final = 0.28
"""Relative error of the variance measured at one level: what scenes add, and what chance does,
which falls with the root of the number of blocks (measured on 16,000 blocks of white noise)."""
_READS: Final = 121
"""Read noises that are tried, 5 % apart."""

FALLBACK_SHOT: Final = 1e-4
"""Taken when a picture is too small to measure: about 10,000 electrons at the white level."""
FALLBACK_READ_VARIANCE: Final = 1e-6

_log = logging.getLogger(__name__)


def repair_mosaic(mosaic: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Replace broken samples of a mosaic by the median of their same-colour neighbours.

    Args:
        mosaic: (h, w) float32, linear, before white balance. A band needs `REPAIR_MARGIN_PX`
            rows of context; results within the context are not those of the whole.

    Returns:
        The repaired mosaic (the same array if nothing was broken) and (h, w) bool, true where a
        sample was replaced.

    Raises:
        ContractError: If the mosaic is not 2-D.
    """
    if mosaic.ndim != 2:
        raise ContractError(f"a mosaic is (h, w); got {mosaic.shape}")
    return _repair(mosaic, step=2)


def repair_planes(planes: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Replace broken samples of full colour planes by the median of their neighbours.

    Args:
        planes: (c, h, w) float32, linear; context as for `repair_mosaic`.

    Returns:
        The repaired planes and (c, h, w) bool, true where a sample was replaced.
    """
    pairs = [_repair(plane, step=1) for plane in planes]
    mask = np.stack([m for _, m in pairs])
    return (np.stack([p for p, _ in pairs]) if mask.any() else planes), mask


def places_of(mask: BoolArray) -> tuple[NDArray[np.intp], ...]:
    """Return what `np.nonzero` gives, in a fraction of its time where few of a mask are true."""
    return np.unravel_index(np.flatnonzero(mask), mask.shape)


def _repair(plane: FloatArray, step: int) -> tuple[FloatArray, BoolArray]:
    broken = ~np.isfinite(plane)
    if broken.any():
        plane = np.where(broken, np.float32(np.nan), plane)
    padded = _pad(plane, 2)
    broken |= _outliers(plane, padded, step)
    if not broken.any():
        return plane, broken
    rows, cols = places_of(broken)
    neighbour_values = neighbours(padded, rows, cols, step)
    repaired = plane.copy()
    repaired[rows, cols] = _median(neighbour_values)
    return repaired, broken


def _pad(plane: FloatArray, margin: int) -> FloatArray:
    """Mirror without repeating the edge, which keeps the CFA phase; a single row is repeated."""
    sides = (margin,) * 4
    return np.asarray(cv2.copyMakeBorder(plane, *sides, cv2.BORDER_REFLECT_101), dtype=np.float32)


def _outliers(plane: FloatArray, padded: FloatArray, step: int) -> BoolArray:
    """Find samples that stand alone; NaN around a sample hides it."""
    alone = np.empty(plane.shape, dtype=bool)
    for top in range(0, len(plane), _CACHED_ROWS):
        bottom = min(top + _CACHED_ROWS, len(plane))
        alone[top:bottom] = _lone_samples(plane[top:bottom], padded[top : bottom + 4], step)
    if step == 2 and alone.any():
        rows, cols = places_of(alone)
        alone[rows, cols] = ~glows(padded, rows, cols)
    return alone


def _lone_samples(plane: FloatArray, padded: FloatArray, step: int) -> BoolArray:
    """Find samples that lie far outside all their neighbours."""
    high = _extreme(padded, step, np.maximum)
    low = _extreme(padded, step, np.minimum)
    limit = high - low
    limit *= OUTLIER_SPREADS
    limit += _OUTLIER_LEAST
    high += limit
    low -= limit
    alone = plane > high
    alone |= plane < low
    return np.asarray(alone)


def _extreme(padded: FloatArray, step: int, choose: np.ufunc) -> FloatArray:
    """Return the largest or smallest of the 8 neighbours at a distance of `step`."""
    inner = padded[2 - step : padded.shape[0] - 2 + step, :]
    centre = inner[:, 2:-2]
    right = inner.shape[1] - 2 + step
    pair = choose(inner[:, 2 - step : right - 2 * step], inner[:, 2 + step : right])
    row = choose(pair, centre)
    result: FloatArray = choose(row[: -2 * step], row[2 * step :])
    return np.asarray(choose(result, pair[step:-step], out=result))


def _median(neighbour_values: FloatArray) -> FloatArray:
    """Return the median of the valid ones of (8, n); 0 where none is."""
    valid = np.isfinite(neighbour_values)
    count = valid.sum(axis=0)
    ordered = np.sort(np.where(valid, neighbour_values, np.inf), axis=0)
    pick = np.arange(neighbour_values.shape[1])
    low, high = ordered[np.maximum(count - 1, 0) // 2, pick], ordered[count // 2 % 8, pick]
    middle = np.where(
        count % 2 == 1, low, 0.5 * (np.where(count > 0, low, 0) + np.where(count > 0, high, 0))
    )
    return np.where(count > 0, middle, 0).astype(np.float32)


def fallback_noise(channels: int = 3) -> NoiseModel:
    """Return the noise that is taken when a picture is too small to measure."""
    return NoiseModel(
        shot=(FALLBACK_SHOT,) * channels, read_variance=(FALLBACK_READ_VARIANCE,) * channels
    )


def measure_noise(capture: Capture) -> NoiseModel:
    """Measure the noise of a capture from its flat blocks.

    The three colours of a sensor share one amplifier, so one line is fitted to all of them.

    Args:
        capture: A mosaic or planes.

    Returns:
        Noise of the linear signal before white balance; `fallback_noise` if the capture holds
        fewer than a handful of usable blocks.

    References: Foi et al. 2008 (line fit); Immerkaer 1996 (high-pass).
    """
    pairs = [_block_statistics(plane) for plane in _sample_planes(capture)]
    levels = np.concatenate([p[0] for p in pairs]) if pairs else np.zeros(0)
    variances = np.concatenate([p[1] for p in pairs]) if pairs else np.zeros(0)
    usable = np.isfinite(levels) & np.isfinite(variances) & (variances > 0)
    if usable.sum() < _LEAST_BLOCKS:
        _log.info("the capture is too small to measure its noise: a default is taken")
        return fallback_noise(capture.channels)
    shot, read_variance = _fit_line(levels[usable], variances[usable])
    count = capture.channels
    return NoiseModel(shot=(shot,) * count, read_variance=(read_variance,) * count)


def over_rounding(noise: NoiseModel, rounding: FloatArray) -> float:
    """Return the variance of noise over that of rounding to codes, the median over codes.

    Args:
        noise: Of a linear signal.
        rounding: (2, n) levels, and the variance of rounding there.
    """
    levels, variances = rounding[:, rounding[1] > 0]
    of_noise = np.mean(noise.shot) * levels + np.mean(noise.read_variance)
    return float(np.median(of_noise / variances))


def _sample_planes(capture: Capture) -> Iterator[FloatArray]:
    """Yield same-colour planes of bands spread over the picture; clipped samples are NaN."""
    step = max(_BAND_ROWS, capture.height // _MAX_BANDS // 2 * 2)
    for top in range(0, capture.height, step):
        bottom = min(top + _BAND_ROWS, capture.height)
        rows = capture.linear_rows(top, bottom)
        rows[capture.saturated_rows(top, bottom)] = np.nan
        if capture.cfa is None:
            yield from rows
        else:
            yield from (rows[dy::2, dx::2] for dy in (0, 1) for dx in (0, 1))


def _block_statistics(plane: FloatArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return level and noise variance of every whole block of a plane."""
    high, wide = ((n - 2) // _BLOCK * _BLOCK for n in plane.shape)
    if high <= 0 or wide <= 0:
        return np.zeros(0), np.zeros(0)
    curved = plane[:, :-2] - 2 * plane[:, 1:-1] + plane[:, 2:]
    detail = curved[:-2] - 2 * curved[1:-1] + curved[2:]

    def blocks(values: FloatArray) -> FloatArray:
        tiled = values[:high, :wide].reshape(high // _BLOCK, _BLOCK, wide // _BLOCK, _BLOCK)
        return tiled.swapaxes(1, 2).reshape(-1, _BLOCK * _BLOCK)

    deviation = _MAD_TO_SIGMA * np.median(np.abs(blocks(detail)), axis=1).astype(np.float64)
    level = blocks(plane[1:-1, 1:-1]).mean(axis=1, dtype=np.float64)
    return level, deviation**2 / _HIGH_PASS_POWER


def _fit_line(levels: NDArray[np.float64], variances: NDArray[np.float64]) -> tuple[float, float]:
    """Fit variance = shot * level + (read_e * shot)^2 through the flat blocks of every level.

    Both parts stay within what sensors do: a slope that chance gives to levels that are nearly one
    is no gain of any amplifier.
    """
    edges = np.unique(np.quantile(levels, np.linspace(0, 1, _LEVELS + 1)))
    bins = np.clip(np.searchsorted(edges, levels, "right") - 1, 0, max(edges.size - 2, 0))
    flat = variances / _FLAT_QUANTILE_OF_NOISE
    places, counts = np.unique(bins, return_counts=True)
    points = [
        (np.median(levels[bins == b]), np.quantile(flat[bins == b], _FLAT_QUANTILE)) for b in places
    ]
    x, y = np.maximum(np.array(points).T, 1e-12)
    spread = np.sqrt(_SPREAD_OF_VARIANCE**2 + _SPREAD_OF_BLOCK**2 / counts)
    fits = [_best_shot(x, y, spread, read_e) for read_e in np.geomspace(*_READ_E, _READS)]
    _, shot, read_e = min(fits)
    return shot, (read_e * shot) ** 2


def _best_shot(
    x: NDArray[np.float64], y: NDArray[np.float64], spread: NDArray[np.float64], read_e: float
) -> tuple[float, float, float]:
    """Return (cost, shot, read noise): the shot noise that fits best with a read noise.

    The sum over levels of (((shot x + (read_e shot)^2) / y - 1) / spread)^2 has its least value
    where its derivative, a cubic in shot, is zero, or at the ends of what is possible. Known is the
    relative error of every level, hence the division by the variance.
    """
    unit = np.sqrt(np.median(y))
    u, v, one = x * unit / y / spread, (read_e * unit) ** 2 / y / spread, 1 / spread
    cubic = [2 * (v @ v), 3 * (u @ v), u @ u - 2 * (v @ one), -(u @ one)]
    roots = unit * np.real(np.roots(cubic))
    shots = np.clip([*roots, *_SHOT], *_SHOT)
    misfit = ((shots[:, None] * x + (read_e * shots[:, None]) ** 2) / y - 1) / spread
    unusual = np.log(read_e / _USUAL_READ_E) / np.log(_USUAL_FACTOR)
    cost = np.sum(misfit**2, axis=1) + unusual**2
    best = int(np.argmin(cost))
    return float(cost[best]), float(shots[best]), float(read_e)

"""Facts about a network, found by running it: the reach of a pixel, the cost of a short halo.

A probe gives a lower bound of the reach (a path may be dead for the probe's input); the walk along
the graph in `reach` gives an upper one. Export records both and tiling takes the larger.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.network.tiling import Run, TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows

_MOST_PHASES: Final = 32
TILE_PX: Final = 128
"""Side of the tiles by which the cost of a short halo is measured."""
_KICK: Final = 1e3  # far beyond the base, so that it survives rounding after many layers


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbedReach:
    """The reach of an input pixel, as seen.

    Attributes:
        radius_px: Largest distance, along an axis, between an input pixel and an output pixel
            that it changes.
        halo_px: Largest distance between an input pixel and the stride cell of such an output
            pixel: what tiling needs when all origins lie on the lattice of the stride.
    """

    radius_px: int
    halo_px: int


@dataclass(frozen=True, slots=True, kw_only=True)
class HaloCost:
    """The cost of a halo against the untiled run.

    Attributes:
        halo_px: The halo.
        max_abs: Largest |difference|, in units of the network's output.
        psnr_db: Peak (largest |untiled output|) to rms difference; None if there is none.
    """

    halo_px: int
    max_abs: float
    psnr_db: float | None


def perturbation_reach(
    run: Run,
    size_px: int,
    rng: np.random.Generator,
    *,
    stride_px: int,
    channels: int,
    scale: int = 1,
) -> ProbedReach:
    """Change one input pixel at the phases of the stride and measure where the output changes.

    Of a stride beyond 32 px so many phases are tried, the first and the last among them.

    Args:
        run: (1, channels, h, w) float32 -> (1, k, s h, s w) float32.
        size_px: Side of the probed window, a multiple of the stride; more than twice the reach.
        rng: Draws the base picture.
        stride_px: Total stride.
        channels: Input planes.
        scale: s, samples along a side of the output for one pixel.

    Returns:
        The reach, at most what the window can show.

    Raises:
        ContractError: If the size is no multiple of the stride, or a change came to the border of
            the window: the reach is larger than it can show, or the network has a global operator.
    """
    if size_px % stride_px or size_px < 4 * stride_px:
        raise ContractError(
            f"the probe's side must be a multiple of {stride_px} and >= {4 * stride_px}; "
            f"got {size_px}"
        )
    base = rng.random((1, channels, size_px, size_px)).astype(np.float32)
    still = run(base).copy()
    cell = size_px // 2 // stride_px * stride_px
    radius = halo = 0
    for phase in _phases(stride_px):
        for kick in (_KICK, -_KICK):
            kicked = base.copy()
            kicked[:, :, cell + phase, cell + phase] += kick
            changed = _by_pixel((run(kicked) != still).any(axis=(0, 1)), scale)
            for axis in range(2):
                hit = np.flatnonzero(changed.any(axis=axis))
                if hit.size and (hit[0] == 0 or hit[-1] == size_px - 1):
                    raise ContractError(
                        f"one pixel acts across the whole window of {size_px} pixels: probe a "
                        "larger one; a network with a global operator cannot be tiled"
                    )
                radius = max(radius, _distance(hit, hit, cell + phase))
                first = hit // stride_px * stride_px
                halo = max(halo, _distance(first, first + stride_px - 1, cell + phase))
    return ProbedReach(radius_px=radius, halo_px=halo)


def _phases(stride_px: int) -> list[int]:
    count = min(stride_px, _MOST_PHASES)
    return sorted({round(i * (stride_px - 1) / max(count - 1, 1)) for i in range(count)})


def probe_runs(stride_px: int) -> int:
    """Return the number of runs of a network for a probe."""
    return 1 + 2 * len(_phases(stride_px))


def _by_pixel(changed: np.ndarray, scale: int) -> np.ndarray:
    """Return (h, w): whether any sample of the output on a pixel changed."""
    height, width = (side // scale for side in changed.shape)
    return np.asarray(changed.reshape(height, scale, width, scale).any(axis=(1, 3)))


def _distance(first: np.ndarray, last: np.ndarray, pixel: int) -> int:
    """Return the largest distance from a pixel to the nearest end of any interval first..last."""
    outside = np.maximum(first - pixel, pixel - last)
    return max(0, int(outside.max(initial=0)))


def halo_error_curve(
    run: Run,
    sample: FloatArray,
    halos_px: Iterable[int],
    *,
    stride_px: int,
    scale: int = 1,
    tile_px: int = TILE_PX,
) -> tuple[HaloCost, ...]:
    """Measure what a halo shorter than the reach costs.

    Args:
        run: The network.
        sample: (c, h, w) float32, stabilised planes as the network sees them, larger than a tile.
        halos_px: Halos to try; each is rounded up to the stride.
        stride_px: Total stride.
        scale: Samples along a side of the output for one pixel.
        tile_px: Output tile; small, so that seams are many and the figures are on the safe side.

    Returns:
        One entry per halo, increasing.

    Raises:
        ContractError: If the sample is not larger than a tile: there would be no seam.
    """
    _, height, width = sample.shape
    if height <= tile_px or width <= tile_px:
        raise ContractError(
            f"the sample must be larger than a tile of {tile_px}; got {width}x{height}"
        )
    whole = _infer(
        run,
        sample,
        TileLimits(stride_px=stride_px, halo_px=0, max_bytes=sys.maxsize, whole=True),
        scale,
    )
    peak = float(np.abs(whole).max())
    costs = []
    for halo in sorted({-(-h // stride_px) * stride_px for h in halos_px}):
        limits = TileLimits(stride_px=stride_px, halo_px=halo, tile_px=tile_px)
        difference = np.abs(_infer(run, sample, limits, scale) - whole)
        rms = float(np.sqrt(np.mean(np.square(difference, dtype=np.float64))))
        costs.append(
            HaloCost(
                halo_px=halo,
                max_abs=float(difference.max()),
                psnr_db=20 * float(np.log10(peak / rms)) if rms > 0 else None,
            )
        )
    return tuple(costs)


def _infer(run: Run, sample: FloatArray, limits: TileLimits, scale: int) -> FloatArray:
    _, height, width = sample.shape
    layout = lay_windows(height, width, limits)
    return np.concatenate(list(infer_bands(run, ArrayRows(sample), layout, scale=scale)), axis=1)

"""Blur that varies over the field: each block of the scene is spread with its own PSF.

Raised-cosine windows of twice the block step share every scene pixel among four blocks, so the
PSF fades from block to block and all energy is kept. (A gather, the PSF of the receiving pixel,
would not be what light does.)

Optics that are the same everywhere need no blocks: one kernel, in tiles that overlap by it.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.progress import counted
from camkit.runtime.geometry.sensor_window import SensorWindow

# Against blocks of 32 px, the lens `duet` loses 48 dB at 256 px and 52 to 55 dB at 128 px.
BLOCK_STEP_PX: Final = 128

TILE_PX: Final = 2048
"""Side of the transforms of one kernel for the whole picture."""

KernelLookup = Callable[[float, float], FloatArray]


def scatter(
    planes: FloatArray,
    kernels_at: KernelLookup,
    window: SensorWindow,
    *,
    margin_px: int,
    step_px: int = BLOCK_STEP_PX,
    workers: int = 1,
) -> FloatArray:
    """Blur colour planes with the PSFs of every block's centre.

    Kernels of neighbouring blocks whose centroids differ pile light up or thin it out where the
    blocks meet. The sum is divided by what it makes of a field of ones, so that equal radiance
    stays equal: vignetting is a factor of its own.

    Args:
        planes: (c, h + 2 margin, w + 2 margin) float32: the window and what lies around it.
        kernels_at: Gives the (c, kh, kw) float32 kernels of a sensor position (x_mm, y_mm); odd
            sides of at most 2 margin + 1.
        window: Where the inner h x w pixels lie on the sensor.
        margin_px: Width of the margin.
        step_px: Distance of block centres.
        workers: Threads of the FFT.

    Returns:
        (c, h, w) float32: the light that arrives inside the window.

    Raises:
        ContractError: If the planes do not have the size of the window with its margin.
    """
    out, light = scatter_light(
        planes, kernels_at, window, margin_px=margin_px, step_px=step_px, workers=workers
    )
    out /= light
    return out


def scatter_light(
    planes: FloatArray,
    kernels_at: KernelLookup,
    window: SensorWindow,
    *,
    margin_px: int,
    step_px: int = BLOCK_STEP_PX,
    workers: int = 1,
) -> tuple[FloatArray, FloatArray]:
    """Blur as `scatter` does, for kernels of any sums.

    Returns:
        (c, h, w) float32: the light that arrives inside the window; the same of planes of ones.

    Raises:
        ContractError: If the planes do not have the size of the window with its margin.
    """
    width, height = window.size_px
    if planes.shape[1:] != (height + 2 * margin_px, width + 2 * margin_px):
        raise ContractError(
            f"the planes must be (c, {height} + 2 * {margin_px}, {width} + 2 * {margin_px}); "
            f"got {planes.shape}"
        )
    out = np.zeros((planes.shape[0], height, width), dtype=np.float32)
    light = np.zeros_like(out)
    places = list(product(_spans(planes.shape[1], step_px), _spans(planes.shape[2], step_px)))
    for (top, bottom, row_weight), (left, right, column_weight) in counted(places, "blurring"):
        weight = row_weight[:, None] * column_weight
        x_px, y_px = (left + right - 1) / 2 - margin_px, (top + bottom - 1) / 2 - margin_px
        x_mm, y_mm = window.to_mm(x_px, y_px)
        kernels = kernels_at(float(x_mm), float(y_mm))
        # of a kernel wider than the window, what throws light of this block into it
        sides = kernels.shape[1:]
        down, y = _reaching(sides[0], top - margin_px, bottom - margin_px, height)
        across, x = _reaching(sides[1], left - margin_px, right - margin_px, width)
        if min(down.stop - down.start, across.stop - across.start) < 1:
            continue
        blocks = (planes[:, top:bottom, left:right] * weight, weight[None])
        spreads = convolve_full(blocks, kernels[:, down, across], workers=workers)
        for total, spread in zip((out, light), spreads, strict=True):
            _add_inside(total, spread, y, x)
    return out, light


def _reaching(side: int, first: int, last: int, inside: int) -> tuple[slice, int]:
    """Return the part of a kernel along an axis that throws light of a block inside.

    Args:
        side: Of the kernel.
        first: Pixel of the block, counted from the first one inside.
        last: One past its last.
        inside: Pixels inside.

    Returns:
        The part, and where the light of `first` through it begins.
    """
    begin = max(0, side // 2 - last + 1)
    end = max(begin, min(side, inside + side // 2 - first))
    return slice(begin, end), first + begin - side // 2


def scatter_uniform(
    planes: FloatArray, kernels: FloatArray, *, margin_px: int, workers: int = 1
) -> FloatArray:
    """Blur colour planes with one kernel each: what `scatter` gives where all places have it.

    For wide kernels this is many times quicker: their transforms are made once, and blocks of
    `BLOCK_STEP_PX` would be lost in a transform that must hold block and kernel.

    Args:
        planes: (c, h + 2 margin, w + 2 margin) float32, as those of `scatter`.
        kernels: (c, kh, kw) float32 that sum to 1; odd sides of at most 2 margin + 1.
        margin_px: Width of the margin.
        workers: Threads of the FFT.

    Returns:
        (c, h, w) float32.

    Raises:
        ContractError: If a kernel reaches beyond the margin, or the planes are all margin.
    """
    import scipy.fft

    sides = kernels.shape[1:]
    height, width = (side - 2 * margin_px for side in planes.shape[1:])
    if max(sides) > 2 * margin_px + 1 or min(height, width) < 1:
        raise ContractError(
            f"kernels of {sides[1]}x{sides[0]} px and planes of {planes.shape[2]}x"
            f"{planes.shape[1]} px do not fit a margin of {margin_px} px"
        )
    # as large as the picture, where a tile would be larger
    full = [
        scipy.fft.next_fast_len(min(n + side - 1, max(TILE_PX, 2 * side)), real=True)
        for n, side in zip((height, width), sides, strict=True)
    ]
    tall, wide = (length - side + 1 for length, side in zip(full, sides, strict=True))
    down, across = (margin_px - side // 2 for side in sides)
    spectrum = scipy.fft.rfft2(kernels, full, workers=workers)
    out = np.empty((planes.shape[0], height, width), dtype=np.float32)
    for top in range(0, height, tall):
        for left in range(0, width, wide):
            block = planes[
                :, top + down : top + down + full[0], left + across : left + across + full[1]
            ]
            lit = scipy.fft.rfft2(block, full, workers=workers)
            lit *= spectrum
            spread = scipy.fft.irfft2(lit, full, workers=workers, overwrite_x=True)
            # what comes round from the other side lies in the first rows and columns
            part = out[:, top : top + tall, left : left + wide]
            part[:] = spread[:, sides[0] - 1 :, sides[1] - 1 :][:, : part.shape[1], : part.shape[2]]
    return out


def _add_inside(out: FloatArray, spread: FloatArray, top: int, left: int) -> None:
    # The corner of `spread` lies at (top, left) of `out`, perhaps outside.
    bottom = min(top + spread.shape[1], out.shape[1])
    right = min(left + spread.shape[2], out.shape[2])
    first_row, first_column = max(top, 0), max(left, 0)
    if bottom > first_row and right > first_column:
        part = spread[:, first_row - top : bottom - top, first_column - left : right - left]
        out[:, first_row:bottom, first_column:right] += part


def convolve_full(
    blocks: Sequence[FloatArray], kernels: FloatArray, *, workers: int = 1
) -> Iterator[FloatArray]:
    """Yield full linear convolutions (c, h + kh - 1, w + kw - 1) by FFT in float32.

    Args:
        blocks: (c, h, w) float32 each, or (1, h, w) for all kernels; of one size.
        kernels: (c, kh, kw) float32, transformed once.
        workers: Threads of the FFT.
    """
    import scipy.fft

    sides = blocks[0].shape[1:]
    full = tuple(b + k - 1 for b, k in zip(sides, kernels.shape[1:], strict=True))
    size = [scipy.fft.next_fast_len(n, real=True) for n in full]
    spectrum = scipy.fft.rfft2(kernels, size, workers=workers)
    for block in blocks:
        lit = spectrum.copy()
        lit *= scipy.fft.rfft2(block, size, workers=workers)
        spread = scipy.fft.irfft2(lit, size, workers=workers, overwrite_x=True)
        yield np.asarray(spread[:, : full[0], : full[1]], dtype=np.float32)


def _spans(length: int, step: int) -> list[tuple[int, int, FloatArray]]:
    # Raised cosines of width 2 step, centred every step, sum to 1 between the outer centres;
    # beyond them the outer windows stay at 1. Blocks at the ends are cut at the picture.
    count = max(1, round(length / step))
    pitch = length / count
    position = np.arange(length, dtype=np.float64) + 0.5
    spans = []
    for index in range(count):
        distance = (position - (index + 0.5) * pitch) / pitch
        if index == 0:
            distance = np.maximum(distance, 0.0)
        if index == count - 1:
            distance = np.minimum(distance, 0.0)
        weight = np.where(np.abs(distance) < 1, 0.5 + 0.5 * np.cos(np.pi * distance), 0.0)
        places = np.flatnonzero(weight)
        first, last = int(places[0]), int(places[-1]) + 1
        spans.append((first, last, weight[first:last].astype(np.float32)))
    return spans

"""A mosaic as smaller planes: every colour averaged over squares of samples, at one place.

    mosaic (h, w) -> light -> means of each colour over squares of 2 or 4 px -> moved to the middle

Red and blue lie half a pixel of the mosaic beside the middle of a square, green on it; a short
filter moves them there. A square with a clipped sample is clipped as a whole.
"""

from dataclasses import replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.runtime.capture import COLOURS, Capture
from camkit.runtime.machine.memory import release_pages
from camkit.runtime.machine.slices import run_chunks

BLACK: Final = 4096
WHITE: Final = 65535
"""Levels of the planes: finer steps than any converter's, and room for noise below black."""
_CELL_PX: Final = 2


def binned_capture(capture: Capture, bin_px: int, *, threads: int = 1) -> Capture:
    """Return a capture whose samples are means over squares of another one's mosaic.

    Rows and columns that fill no square are left out, at the bottom and at the right. What is known
    of the noise becomes that of the means; the place on the sensor stays that of the mosaic.

    Args:
        capture: A mosaic.
        bin_px: Side of a square, even.
        threads: Threads to compute with; no influence on the bits.

    Raises:
        ContractError: If it is no mosaic, or smaller than a square.
    """
    if capture.cfa is None or bin_px % _CELL_PX or min(capture.height, capture.width) < bin_px:
        raise ContractError(
            f"squares of {bin_px} px need a mosaic with at least one; got {capture.plane_shape}"
        )
    means, clipped = _means(capture, capture.cfa, bin_px, threads)
    for plane, (down, across) in zip(means, colour_offsets(capture.cfa), strict=True):
        kernels = (shift_weights(-offset / bin_px) for offset in (across, down))
        cv2.sepFilter2D(plane, -1, *kernels, dst=plane, borderType=cv2.BORDER_REPLICATE)
    means *= np.float32(WHITE - BLACK)
    means += np.float32(BLACK)
    np.clip(np.rint(means, out=means), 0, WHITE, out=means)
    samples = means.astype(np.uint16)
    samples[clipped] = WHITE
    factors = noise_factors(capture.cfa, bin_px)
    return replace(
        capture,
        samples=samples,
        cfa=None,
        bin_px=bin_px,
        noise_factors=factors,
        black_level=np.full(COLOURS, BLACK, np.float32),
        white_level=float(WHITE),
        noise=None if capture.noise is None else capture.noise.raised(factors),
        window=None,
    )


def colour_offsets(cfa: CfaPattern) -> tuple[tuple[float, float], ...]:
    """Return (down, across) from the middle of a cell to the mean place of every colour, in px."""
    cell = np.array(cfa_channels(cfa))
    places = (np.argwhere(cell == colour).mean(axis=0) - 0.5 for colour in range(COLOURS))
    return tuple((float(down), float(across)) for down, across in places)


def noise_factors(cfa: CfaPattern, bin_px: int) -> tuple[float, ...]:
    """Return the variance of a mean of every colour over that of a sample."""
    cell = np.array(cfa_channels(cfa))
    squares = (bin_px // _CELL_PX) ** 2
    return tuple(
        float(np.prod([np.square(shift_weights(-o / bin_px)).sum() for o in offsets]))
        / (squares * int((cell == colour).sum()))
        for colour, offsets in enumerate(colour_offsets(cfa))
    )


def shift_weights(to: float) -> FloatArray:
    """Return (5,): weights of samples -2..2 for the signal at a place -0.5..0.5 among them.

    References: Keys 1981, cubic convolution with a = -1/2.
    """
    distance = np.abs(np.arange(-2, 3) - to)
    near = (1.5 * distance - 2.5) * distance**2 + 1
    far = ((-0.5 * distance + 2.5) * distance - 4) * distance + 2
    return np.where(distance < 1, near, np.where(distance < 2, far, 0)).astype(np.float32)


def _means(
    capture: Capture, cfa: CfaPattern, bin_px: int, threads: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return (3, h, w) means of the light of every colour, and where any of its samples clipped."""
    height, width = capture.height // bin_px, capture.width // bin_px
    means = np.empty((COLOURS, height, width), np.float32)
    clipped = np.empty(means.shape, np.bool_)
    sites = [(y, x) for y in range(bin_px) for x in range(bin_px)]
    colours = [cfa_channels(cfa)[y % _CELL_PX][x % _CELL_PX] for y, x in sites]

    def fill(first: int, last: int) -> None:
        rows = first * bin_px, last * bin_px
        light, full = capture.linear_rows(*rows), capture.saturated_rows(*rows)
        if np.issubdtype(capture.samples.dtype, np.floating):
            np.nan_to_num(light, copy=False)
        for colour in range(COLOURS):
            own = [site for site, at in zip(sites, colours, strict=True) if at == colour]
            parts = [np.s_[y::bin_px, x : width * bin_px : bin_px] for y, x in own]
            total = sum((light[part] for part in parts[1:]), start=light[parts[0]])
            means[colour, first:last] = total * np.float32(1 / len(own))
            clipped[colour, first:last] = np.logical_or.reduce([full[part] for part in parts])

    run_chunks(fill, height, width * bin_px, threads=threads)
    release_pages(capture.samples)
    return means, clipped

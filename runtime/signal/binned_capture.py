"""A mosaic as smaller planes: every colour averaged over squares of samples, at one place.

    mosaic (h, w) -> light -> means of each colour over squares of 2 or 4 px -> moved to the middle

A square with a clipped sample is clipped as a whole, in that colour.
"""

from dataclasses import replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.binning import COLOURS, Binning
from camkit.runtime.capture import Capture
from camkit.runtime.machine.memory import release_pages
from camkit.runtime.machine.slices import run_chunks

BLACK: Final = 4096
WHITE: Final = 65535
"""Levels of the planes: finer steps than any converter's, and room for noise below black."""


def binned_capture(capture: Capture, side_px: int, *, threads: int = 1) -> Capture:
    """Return a capture whose samples are means over squares of another one's mosaic.

    Rows and columns that fill no square are left out, at the bottom and at the right. What is known
    of the noise becomes that of the means; the place on the sensor stays that of the mosaic.

    Args:
        capture: A mosaic.
        side_px: Side of a square, even.
        threads: Threads to compute with; no influence on the bits.

    Raises:
        ContractError: If it is no mosaic, or smaller than a square.
    """
    if capture.cfa is None or min(capture.height, capture.width) < side_px:
        raise ContractError(
            f"squares of {side_px} px need a mosaic with at least one; got {capture.plane_shape}"
        )
    binning = Binning(side_px=side_px, cfa=capture.cfa)
    means, clipped = _means(capture, binning, threads)
    for colour, plane in enumerate(means):
        down, across = binning.shift_weights(colour)
        cv2.sepFilter2D(plane, -1, across, down, dst=plane, borderType=cv2.BORDER_REPLICATE)
    means *= np.float32(WHITE - BLACK)
    means += np.float32(BLACK)
    np.clip(np.rint(means, out=means), 0, WHITE, out=means)
    samples = means.astype(np.uint16)
    samples[clipped] = WHITE
    noise = capture.noise
    return replace(
        capture,
        samples=samples,
        cfa=None,
        binning=binning,
        black_level=np.full(COLOURS, BLACK, np.float32),
        white_level=float(WHITE),
        noise=None if noise is None else noise.raised(binning.noise_factors),
        window=None,
    )


def _means(
    capture: Capture, binning: Binning, threads: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return (3, h, w) means of the light of every colour, and where any of its samples clipped."""
    side = binning.side_px
    height, width = capture.height // side, capture.width // side
    means = np.empty((COLOURS, height, width), np.float32)
    clipped = np.empty(means.shape, np.bool_)

    def fill(first: int, last: int) -> None:
        light = capture.linear_rows(first * side, last * side)
        full = capture.saturated_rows(first * side, last * side)
        if np.issubdtype(capture.samples.dtype, np.floating):
            np.nan_to_num(light, copy=False)
        for colour in range(COLOURS):
            sites = binning.sites(colour)
            parts = [np.s_[y::side, x : width * side : side] for y, x in sites]
            total = sum((light[part] for part in parts[1:]), start=light[parts[0]])
            means[colour, first:last] = total * np.float32(1 / len(sites))
            clipped[colour, first:last] = np.logical_or.reduce([full[part] for part in parts])

    run_chunks(fill, height, width * side, threads=threads)
    release_pages(capture.samples)
    return means, clipped

"""The content of a capture, measured cheaply on a fixed lattice of cells before any work.

    4 rows of every 16 -> colours of the 2x2 cells, white-balanced -> sqrt(x + BLACK)
        -> mean squared step to the neighbours, per lattice cell, minus what noise alone gives

The square root stands for the sRGB curve (equal slope at black), so `detail` and `noise` are in
units of squared sRGB values. The lattice begins at the capture's first pixel and depends on nothing
but its size; cells at the right and lower border may be smaller.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import cfa_channels
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.units import to_mm

CELL_PX: Final = 256
"""Side of a lattice cell in pixels of the capture."""
GROUP_ROWS: Final = 4
STEP_ROWS: Final = 16
"""Of every STEP_ROWS rows the first GROUP_ROWS are looked at: a quarter of the samples."""
BLACK: Final = 0.0015
"""(0.5 / 12.92)^2: there the square root is as steep as the sRGB curve at black."""
LEAST_DETAIL: Final = 1e-7
"""Detail below this (a third of a step of 8 bits, squared) counts as none."""
LEAST_NOISE: Final = 1e-9
SPILL: Final = 0.3
"""Share of the strongest detail around a cell that counts for it: blur carries light over borders,
and a cell without a network keeps what its neighbours threw into it."""
TELLABLE: Final = 0.03
"""Detail below this share of the noise cannot be told from noise (2 % is one standard deviation
of a cell's steps) and counts as this much."""

LIGHT_PX: Final = 32
"""Side of the squares that say where samples are clipped."""

CellArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """A capture on the lattice.

    Attributes:
        height_px: Rows of the capture.
        width_px: Columns of the capture.
        sensor_share: Area of the capture over that of the bundle's sensor.
        level: (row, column) mean of the linear signal, 1.0 = white level.
        detail: (row, column) >= LEAST_DETAIL, squared sRGB values: steps beyond the noise.
        noise: (row, column) > 0, squared sRGB values: steps that noise alone makes.
        clipped: (row, column) share of 2x2 cells with a clipped sample.
        field: (row, column) distance of the cell's middle from the axis over the half diagonal of
            the sensor.
        lights: (row, column) of LIGHT_PX squares, true where any sample is clipped; every sample
            was looked at.
    """

    height_px: int
    width_px: int
    sensor_share: float
    level: CellArray
    detail: CellArray
    noise: CellArray
    clipped: CellArray
    field: CellArray
    lights: NDArray[np.bool_]

    def __post_init__(self) -> None:
        shape = lattice_shape(self.height_px, self.width_px)
        for name in ("level", "detail", "noise", "clipped", "field"):
            got = getattr(self, name)
            if got.shape != shape or not np.isfinite(got).all():
                raise ContractError(f"{name} must be finite {shape} cells; got {got.shape}")
        places = -(-self.height_px // LIGHT_PX), -(-self.width_px // LIGHT_PX)
        if self.lights.shape != places:
            raise ContractError(f"lights must be {places} squares; got {self.lights.shape}")
        if (self.detail <= 0).any() or (self.noise <= 0).any():
            raise ContractError("detail and noise must be > 0")

    @property
    def shape(self) -> tuple[int, int]:
        """Return (rows, columns) of the lattice."""
        return lattice_shape(self.height_px, self.width_px)

    @property
    def cell_px(self) -> CellArray:
        """Return the pixels of every cell."""
        return cell_area_px(self.height_px, self.width_px)

    @property
    def blurred_detail(self) -> CellArray:
        """Return detail (row, column) that blur leaves in a cell: its own and its neighbours'."""
        import scipy.ndimage

        largest = scipy.ndimage.maximum_filter(self.detail, size=3, mode="nearest")
        return np.asarray(self.detail + SPILL * largest)

    @property
    def clipped_fraction(self) -> float:
        """Return the share of 2x2 cells with a clipped sample in the whole capture."""
        return float((self.clipped * self.cell_px).sum() / self.cell_px.sum())

    def to_json(self) -> dict[str, float | int | list[int]]:
        """Return the capture in a few numbers, for the plan."""
        return {
            "size_px": [self.width_px, self.height_px],
            "cells": int(self.level.size),
            "sensor_share": round(self.sensor_share, 4),
            "clipped_fraction": round(self.clipped_fraction, 6),
            "median_level": round(float(np.median(self.level)), 6),
            "median_detail_rms": round(float(np.sqrt(np.median(self.detail))), 6),
            "median_noise_rms": round(float(np.sqrt(np.median(self.noise))), 6),
        }


def lattice_shape(height_px: int, width_px: int) -> tuple[int, int]:
    """Return (rows, columns) of cells that cover a picture."""
    return -(-height_px // CELL_PX), -(-width_px // CELL_PX)


def cell_area_px(height_px: int, width_px: int) -> CellArray:
    """Return (rows, columns) pixels of every cell; less than CELL_PX^2 at the far borders."""
    rows, columns = (
        np.diff([*range(0, size, CELL_PX), size]).astype(np.float64)
        for size in (height_px, width_px)
    )
    return np.asarray(rows[:, None] * columns)


def measure_content(
    capture: Capture,
    noise: NoiseModel,
    white_balance: tuple[float, ...],
    window: SensorWindow,
) -> Content:
    """Measure a capture on the lattice.

    Args:
        capture: A mosaic or planes.
        noise: Noise after white balance.
        white_balance: One gain per channel.
        window: Where the capture lies on the sensor.

    Raises:
        ContractError: If the window is of another size.
    """
    if window.size_px != (capture.width, capture.height):
        raise ContractError(
            f"the window is of {window.size_px} px, the capture {capture.width}x{capture.height}"
        )
    sums = _Sums(capture, noise)
    for top in range(0, capture.height, STEP_ROWS):
        bins = _bins(capture, top, white_balance)
        sums.add(top // CELL_PX, bins, _clipped_bins(capture, top))
    width_px, height_px = window.sensor_size_px
    level, detail, expected, clipped = sums.means()
    noise_steps = np.maximum(expected, LEAST_NOISE)
    least = np.maximum(TELLABLE * noise_steps, LEAST_DETAIL)
    return Content(
        height_px=capture.height,
        width_px=capture.width,
        sensor_share=capture.height * capture.width / (width_px * height_px),
        level=level,
        detail=np.maximum(detail - expected, least),
        noise=noise_steps,
        clipped=clipped,
        field=_field(window, capture.height, capture.width),
        lights=light_squares(capture),
    )


def _bins(capture: Capture, top: int, gains: tuple[float, ...]) -> FloatArray:
    """Return (c, rows / 2, columns / 2): colours of the 2x2 cells of one group of rows."""
    rows = capture.linear_rows(top, min(top + GROUP_ROWS, capture.height))
    if np.issubdtype(capture.samples.dtype, np.floating):
        rows = np.nan_to_num(rows, posinf=1.0, neginf=0.0)
    if capture.cfa is None:
        return np.asarray(rows[:, ::2, ::2] * np.array(gains, np.float32)[:, None, None])
    if rows.shape[0] % 2 or rows.shape[1] % 2:
        rows = np.pad(rows, ((0, rows.shape[0] % 2), (0, rows.shape[1] % 2)), mode="edge")
    bins = np.zeros((3, rows.shape[0] // 2, rows.shape[1] // 2), np.float32)
    for dy, channels in enumerate(cfa_channels(capture.cfa)):
        for dx, channel in enumerate(channels):
            weight = gains[channel] * (0.5 if channel == 1 else 1.0)
            bins[channel] += np.float32(weight) * rows[dy::2, dx::2]
    return bins


def _clipped_bins(capture: Capture, top: int) -> NDArray[np.float32]:
    """Return (rows / 2, columns / 2): 1 where a sample of the 2x2 cell is clipped."""
    clipped = capture.saturated_rows(top, min(top + GROUP_ROWS, capture.height))
    if clipped.ndim == 3:
        clipped = np.asarray(clipped.any(axis=0))
    pad = ((0, clipped.shape[0] % 2), (0, clipped.shape[1] % 2))
    even = np.pad(clipped, pad, mode="edge") if pad != ((0, 0), (0, 0)) else clipped
    above, below = even[::2], even[1::2]
    return np.asarray(
        above[:, ::2] | above[:, 1::2] | below[:, ::2] | below[:, 1::2], dtype=np.float32
    )


def light_squares(capture: Capture) -> NDArray[np.bool_]:
    """Return (row, column) of the squares of LIGHT_PX, true where any sample is clipped."""
    height, width = capture.height, capture.width
    lefts = np.arange(0, width, LIGHT_PX)
    squares = np.zeros((-(-height // LIGHT_PX), lefts.size), dtype=np.bool_)
    for row, top in enumerate(range(0, height, LIGHT_PX)):
        clipped = capture.saturated_rows(top, min(top + LIGHT_PX, height))
        columns = clipped.reshape(-1, width).any(axis=0)
        squares[row] = np.logical_or.reduceat(columns, lefts)
    return squares


class _Sums:
    """Sums per cell, filled group of rows by group of rows, in a fixed order."""

    def __init__(self, capture: Capture, noise: NoiseModel) -> None:
        rows, columns = lattice_shape(capture.height, capture.width)
        self._starts = np.arange(columns) * (CELL_PX // 2)
        self._totals = np.zeros((5, rows, columns))
        self._counts = np.zeros((5, rows, columns))
        # Green is the mean of two samples of a mosaic, which halves its variance.
        share = np.ones(capture.channels)
        if capture.cfa is not None:
            share[1] = 0.5
        middle = capture.channels // 2
        self._level = slice(middle, middle + 1)
        self._shot = (np.array(noise.shot) * share).astype(np.float32)[:, None, None]
        self._read = (np.array(noise.read_variance) * share).astype(np.float32)[:, None, None]

    def add(self, row: int, bins: FloatArray, clipped: FloatArray) -> None:
        """Add one group; bins are (c, rows, columns), clipped (rows, columns)."""
        lifted = np.maximum(bins + np.float32(BLACK), np.float32(BLACK / 100))
        curved = np.sqrt(lifted)
        variance = self._shot * np.maximum(bins, 0) + self._read
        # d sqrt(x) / dx = 1 / (2 sqrt(x)); a step holds the noise of two bins.
        expected = variance / (2 * np.maximum(lifted, np.float32(BLACK)))
        # The first column has no left neighbour: its step counts as 0.
        across = np.square(np.diff(curved, axis=2, prepend=curved[:, :, :1]))
        self._add_row(0, row, bins[self._level])
        self._add_row(1, row, across)
        self._add_row(2, row, np.square(np.diff(curved, axis=1)))
        self._add_row(3, row, expected)
        self._add_row(4, row, clipped[None])

    def _add_row(self, which: int, row: int, values: FloatArray) -> None:
        columns = values.sum(axis=(0, 1), dtype=np.float64)
        self._totals[which, row] += np.add.reduceat(columns, self._starts)
        widths = np.diff(np.append(self._starts, values.shape[2]))
        self._counts[which, row] += widths * (values.shape[0] * values.shape[1])

    def means(self) -> tuple[CellArray, CellArray, CellArray, CellArray]:
        """Return mean level, squared step, expected squared step, clipped share per cell."""
        level, across, down, expected, clipped = self._totals / np.maximum(self._counts, 1)
        return level, (across + down) / 2, expected, clipped


def _field(window: SensorWindow, height_px: int, width_px: int) -> CellArray:
    """Return the distance of every cell's middle from the axis over the sensor's half diagonal."""
    rows, columns = (
        np.array([(a + min(a + CELL_PX, size) - 1) / 2 for a in range(0, size, CELL_PX)])
        for size in (height_px, width_px)
    )
    x_mm, y_mm = window.to_mm(*np.meshgrid(columns, rows))
    corner_mm = to_mm(window.pitch_um) * np.hypot(*window.sensor_size_px) / 2
    return np.asarray(np.hypot(x_mm, y_mm) / corner_mm, dtype=np.float64)

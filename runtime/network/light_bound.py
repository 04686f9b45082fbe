"""The bound on what a network adds to the picture in front of it: detail, but no light.

    front, output --> added, by cells --> beyond the bound --> output with that taken back

A stabilised value s stands for the light s^2, so the light that a network adds is
(output - front) (output + front). Its mean over a cell, divided by the mean of the second factor,
is the change of s that moves as much light everywhere alike. That change is bounded; what exceeds
the bound is interpolated between cells and subtracted. Sums are taken in one order wherever a cell
lies, so windows of a picture equal the whole in bits.

Format: camkit/bundle/light_bound.py. Twin: camkit/models_def/networks/light.py.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.light_bound import (
    BRIGHT_FROM,
    BRIGHT_NOISE,
    CELL_PX,
    CELLS_AVERAGED,
    NEAR_PX,
    NOISE_OF_CELLS,
    SMOOTHING,
    USUAL_BOUND,
    LightBound,
)
from camkit.errors import ContractError
from camkit.runtime.rows import RowSource

MASK_ROWS: Final = max(NEAR_PX)
"""Rows of the mask above and below those that it decides."""
LARGE_CHANGE: Final = 0.2
"""Share of the light; who moves more of it makes another picture."""
_TINY: Final = np.float32(1e-6)
_PHASES: Final = tuple((k + 0.5) / CELL_PX - 0.5 for k in range(CELL_PX))
"""Places of the pixels of a cell between the centres of cells, in cells."""
_STEP_CELLS: Final = 128
"""Rows of cells that are computed at once. With fewer, the calls cost more than the sums, and
threads wait for one another."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class AddedLight:
    """The light that a network adds to a window, by cells.

    Attributes:
        excess: (c, h / 4, w / 4) change of the stabilised value to be taken back.
        unexplained: (h / 4, w / 4) whether the network's own local mean left the usual bound and
            the one that was asked for.
        large: Of these, where it moved more than a fifth of the light.
    """

    excess: FloatArray
    unexplained: Mask
    large: Mask


def keep_share(unknown: NDArray[Any]) -> FloatArray | None:
    """Return (h, w), how much of what a network adds is kept beside clipped samples.

    Args:
        unknown: (h, w) or (c, h, w) bool, clipped samples.

    Returns:
        0 beside clipped samples, 1 far from them; None if there are none.
    """
    plane = unknown if unknown.ndim == 2 else unknown.any(axis=0)
    if not plane.any():
        return None
    clipped = plane.astype(np.uint8)
    share = np.ones(plane.shape, np.float32)
    for reach in NEAR_PX:
        square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
        share -= np.float32(1 / len(NEAR_PX)) * cv2.dilate(clipped, square)
    return share


class KeptRows:
    """Rows of `keep_share`, from those of a mask of clipped samples."""

    def __init__(self, mask: RowSource) -> None:
        self._mask = mask

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (1, h, w)."""
        _, height, width = self._mask.shape
        return 1, height, width

    def read(self, top: int, bottom: int) -> FloatArray:
        """Return rows top..bottom."""
        _, height, _ = self.shape
        above, below = max(top - MASK_ROWS, 0), min(bottom + MASK_ROWS, height)
        unknown = self._mask.read(above, below)
        share = keep_share(unknown)
        if share is None:
            return np.ones((1, bottom - top, unknown.shape[2]), np.float32)
        return share[None, top - above : bottom - above]


def added_light(
    front: FloatArray,
    output: FloatArray,
    kept_share: FloatArray | None,
    bound: LightBound,
    *,
    scale: float,
) -> AddedLight:
    """Compute what a network adds to a window beyond its bound.

    Args:
        front: (c, h, w) float32, stabilised: the plane that the network improves on; h, w multiples
            of the side of a cell.
        output: (c, h, w) float32, stabilised; what lies below 0 becomes 0 in place.
        kept_share: (h, w) of `keep_share`; None for 1 everywhere.
        bound: Of the manifest.
        scale: Divisor of the stabilising transform; the noise there is 0.5 / scale.

    Raises:
        ContractError: If the shapes disagree, or a side is no multiple of the side of a cell.
    """
    channels, height, width = _checked(front, output)
    rows, columns = height // CELL_PX, width // CELL_PX
    light_change, weight, level = (
        np.empty((channels, rows, columns), np.float32) for _ in range(3)
    )

    both, more = np.empty((2, CELL_PX * _STEP_CELLS, width), np.float32)
    with _quiet():
        for top, bottom in _steps(rows):
            pixels = slice(CELL_PX * top, CELL_PX * bottom)
            sums, changes = both[: CELL_PX * (bottom - top)], more[: CELL_PX * (bottom - top)]
            for channel in range(channels):
                before, after = front[channel, pixels], output[channel, pixels]
                np.maximum(after, 0, out=after)  # below it lies no light
                np.add(after, before, out=sums)
                np.subtract(after, before, out=changes)
                if kept_share is not None:
                    sums *= kept_share[pixels]
                changes *= sums
                _cell_means(changes, light_change[channel, top:bottom])
                _cell_means(sums, weight[channel, top:bottom])
                _cell_means(before, level[channel, top:bottom])
        return _judged(light_change, weight, level, bound, scale)


def _steps(rows: int) -> Iterator[tuple[int, int]]:
    """Yield first and last row of cells that are computed at once."""
    for top in range(0, rows, _STEP_CELLS):
        yield top, min(top + _STEP_CELLS, rows)


def _quiet() -> np.errstate:
    """Return a context without warnings: the guard of tiles names networks that explode."""
    return np.errstate(invalid="ignore", over="ignore")


def _judged(
    light_change: FloatArray, weight: FloatArray, level: FloatArray, bound: LightBound, scale: float
) -> AddedLight:
    """Compute what is beyond the bounds from the means of cells."""
    change = _smoothed(light_change)
    change /= np.maximum(_smoothed(weight), _TINY)
    mean = _smoothed(level)
    moments = mean, np.maximum(_smoothed(np.square(level)) - np.square(mean), 0)
    usual = _limit(*moments, USUAL_BOUND, scale)
    limit = usual if bound == USUAL_BOUND else _limit(*moments, bound, scale)
    moved_by = np.abs(change)
    unexplained = moved_by > np.maximum(usual, limit)
    return AddedLight(
        excess=change - np.clip(change, -limit, limit),
        unexplained=np.asarray(unexplained.any(axis=0)),
        large=np.asarray(
            (unexplained & (moved_by > np.float32(LARGE_CHANGE / 2) * mean)).any(axis=0)
        ),
    )


def take_back(
    front: FloatArray,
    output: FloatArray,
    kept_share: FloatArray | None,
    excess: FloatArray | None,
    *,
    strength: float = 1.0,
) -> None:
    """Remove from an output, in place, the part that is not kept.

    Args:
        front: (c, h, w) float32, stabilised.
        output: (c, h, w) float32, stabilised; changed.
        kept_share: (h, w) of `keep_share`; None for 1 everywhere.
        excess: (c, h / 4, w / 4) of `added_light`; None for nothing, with sides of any length.
        strength: How much of what is left of the change is kept, 0..1.
    """
    channels, height, _ = front.shape if excess is None else _checked(front, output)
    shares = kept_share
    if strength != 1.0:
        shares = np.float32(strength) * (
            np.ones(1, np.float32) if kept_share is None else kept_share
        )

    for top, bottom in _steps(-(-height // CELL_PX)):
        pixels = slice(CELL_PX * top, CELL_PX * bottom)
        for channel in range(channels):
            rows = output[channel, pixels]
            if excess is not None:
                _subtract(rows, excess[channel], top, bottom)
            if shares is not None:
                share = shares[pixels] if shares.ndim == 2 else shares
                _mix(rows, front[channel, pixels], share)


def keep_bright(front: FloatArray, output: FloatArray, bright: FloatArray, *, scale: float) -> None:
    """Prevent an output, in place, from darkening nearly white light in front of a network.

    Args:
        front: (c, h, w) float32, stabilised: the plane that the network improves on.
        output: (c, h, w) float32, stabilised, at least 0; changed.
        bright: (c,) stabilised value of `BRIGHT` in every channel.
        scale: Divisor of the stabilising transform; the noise there is 0.5 / scale.
    """
    margin = np.float32(BRIGHT_NOISE * 0.5 / scale)
    height = front.shape[1]
    for top in range(0, height, CELL_PX * _STEP_CELLS):
        rows = np.s_[:, top : min(top + CELL_PX * _STEP_CELLS, height)]
        share = _bright_share(front[rows], bright)
        if share is None:
            continue
        for before, after in zip(front[rows], output[rows], strict=True):
            least = before * share
            least -= margin
            np.maximum(after, least, out=after)


def _bright_share(planes: FloatArray, bright: FloatArray) -> FloatArray | None:
    """Return (h, w): the share of its value that a pixel keeps; None where none keeps any."""
    least = planes[0] / bright[0]
    for plane, level in zip(planes[1:], bright[1:], strict=True):
        np.minimum(least, plane / level, out=least)
    if least.max() <= BRIGHT_FROM:
        return None
    least -= np.float32(BRIGHT_FROM)
    least *= np.float32(1 / (1 - BRIGHT_FROM))
    return np.asarray(np.clip(least, 0, 1, out=least))


def _mix(rows: FloatArray, front: FloatArray, shares: FloatArray) -> None:
    """Blend a share of the change; where all of it is kept, bits stay as without any mask."""
    mixed = rows - front
    mixed *= shares
    mixed += front
    np.copyto(rows, mixed, where=shares < 1)


def _subtract(rows: FloatArray, excess: FloatArray, top: int, bottom: int) -> None:
    """Subtract cells top..bottom, interpolated, from their pixels."""
    above, below = max(top - 1, 0), min(bottom + 1, len(excess))
    columns = _enlarge_columns(excess[above:below])
    if above == top:
        columns = np.concatenate([columns[:1], columns])
    if below == bottom:
        columns = np.concatenate([columns, columns[-1:]])
    part = np.empty_like(columns)
    for at in _PHASES[: CELL_PX // 2]:  # the other half of a cell mirrors the first
        near, far = _PHASES.index(at), CELL_PX - 1 - _PHASES.index(at)
        np.multiply(columns, np.float32(1 + at), out=part)
        rows[near::CELL_PX] -= part[1:-1]
        rows[far::CELL_PX] -= part[1:-1]
        np.multiply(columns, np.float32(-at), out=part)
        rows[near::CELL_PX] -= part[:-2]
        rows[far::CELL_PX] -= part[2:]


def _enlarge_columns(cells: FloatArray) -> FloatArray:
    """Return (rows, 4 w) of (rows, w) cells, interpolated between their centres along rows."""
    padded = np.pad(cells, ((0, 0), (1, 1)), mode="edge")
    fine = np.empty((len(cells), cells.shape[1], CELL_PX), np.float32)
    for phase, at in enumerate(_PHASES):
        neighbour = padded[:, :-2] if at < 0 else padded[:, 2:]
        np.multiply(cells, np.float32(1 - abs(at)), out=fine[:, :, phase])
        fine[:, :, phase] += np.float32(abs(at)) * neighbour
    return fine.reshape(len(cells), -1)


def _cell_means(plane: FloatArray, out: FloatArray) -> None:
    """Fill in the means of cells; rows are added before columns, in order."""
    rows = plane[::CELL_PX] + plane[1::CELL_PX]
    for k in range(2, CELL_PX):
        rows += plane[k::CELL_PX]
    np.add(rows[:, ::CELL_PX], rows[:, 1::CELL_PX], out=out)
    for k in range(2, CELL_PX):
        out += rows[:, k::CELL_PX]
    out *= np.float32(1 / CELL_PX**2)


def _smoothed(cells: FloatArray) -> FloatArray:
    """Return cells smoothed along columns and rows; the border is repeated."""
    side, centre, _ = (np.float32(weight) for weight in SMOOTHING)
    padded = np.pad(cells, ((0, 0), (1, 1), (1, 1)), mode="edge")
    down = centre * padded[:, 1:-1]
    down += side * (padded[:, :-2] + padded[:, 2:])
    across = centre * down[:, :, 1:-1]
    across += side * (down[:, :, :-2] + down[:, :, 2:])
    return np.asarray(across, dtype=np.float32)


def _limit(mean: FloatArray, spread: FloatArray, bound: LightBound, scale: float) -> FloatArray:
    """Return the most by which a smoothed cell may leave the front end, of mean and variance."""
    cell = (0.5 / scale / CELL_PX) ** 2
    excess = np.maximum(spread - np.float32(NOISE_OF_CELLS * cell), 0)
    variance = np.float32(bound.spread**2) * excess
    variance += np.float32(bound.noise**2 * cell / CELLS_AVERAGED)
    if bound.light:
        variance += np.square(np.float32(bound.light / 2) * mean)
    return np.asarray(np.sqrt(variance), dtype=np.float32)


def _checked(front: FloatArray, output: FloatArray) -> tuple[int, int, int]:
    shape = front.shape
    if output.shape != shape or len(shape) != 3 or shape[1] % CELL_PX or shape[2] % CELL_PX:
        raise ContractError(
            f"front end and output must be (c, h, w) with sides in multiples of {CELL_PX}; got "
            f"{front.shape} and {output.shape}"
        )
    return shape

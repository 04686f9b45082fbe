"""Where the bracket of a scene lies on its coded capture: one shift and a gain per colour.

Looked for beside the largest light alone. A plate put on a lens moves what it sees by more than a
shift; `local_shifts` says how much.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import scipy.fft
import scipy.ndimage
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.errors import DecodeError

AROUND_PX: Final = 60.0
JOINED_PX: Final = 4
"""Clipped pixels this near to each other, from both sides, are of one light."""
FARTHEST_PX: Final = 25
BLOCK_PX: Final = 128
DETAIL_PX: Final = 8.0
ALIKE: Final = 0.8
"""A block whose details are explained this badly, of their own size, has no shift of its own."""
FAINT: Final = 1e-5

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Laid:
    """Where a reference lies on a capture.

    Attributes:
        shift_px: (y, x) that the reference is moved by.
        gain: (3,) that it is multiplied by: what the plate lets through, per colour.
        misfit: Of the square roots of light, of their own size.
    """

    shift_px: tuple[float, float]
    gain: FloatArray
    misfit: float

    def on(self, picture: FloatArray) -> FloatArray:
        """Return a picture (3, h, w) laid on the capture; light stays positive between pixels."""
        logs = np.log(np.maximum(picture, FAINT))
        moved = [scipy.ndimage.shift(p, self.shift_px, order=3, mode="nearest") for p in logs]
        return np.asarray(np.exp(np.stack(moved)) * self.gain[:, None, None], np.float32)

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "shift_px": [round(side, 2) for side in self.shift_px],
            "gain": [round(float(g), 3) for g in self.gain],
            "misfit": round(self.misfit, 4),
        }


def largest_light(clipped: Mask) -> Mask:
    """Tell the pixels (h, w) of the largest light among clipped samples (3, h, w).

    Raises:
        DecodeError: If nothing clipped.
    """
    over = np.asarray(clipped.any(axis=0))
    labels, count = scipy.ndimage.label(scipy.ndimage.binary_dilation(over, iterations=JOINED_PX))
    if not count:
        raise DecodeError("nothing clipped in the capture: there is nothing to recover")
    sizes = scipy.ndimage.sum_labels(over, labels, range(1, count + 1))
    return np.asarray(over & (labels == 1 + int(np.argmax(sizes))))


def around_light(clipped: Mask) -> Mask:
    """Tell the pixels (h, w) that did not clip near the largest light, none of them beside one."""
    near = scipy.ndimage.distance_transform_edt(~largest_light(clipped)) <= AROUND_PX
    return np.asarray(near & ~scipy.ndimage.binary_dilation(np.asarray(clipped.any(axis=0))))


def lay(capture: FloatArray, expected: FloatArray, where: Mask) -> Laid:
    """Find where what is expected lies on a capture: least squares on the roots of light.

    Args:
        capture: (3, h, w).
        expected: (3, h, w), the reference through the plate.
        where: (h, w) pixels of the capture that are compared.
    """
    seen, told = (np.sqrt(np.maximum(p, 0)) for p in (capture, expected))
    rest, met = _rests(seen, told, where)
    middle = FARTHEST_PX
    row, column = (int(n) for n in np.unravel_index(int(rest.argmin()), rest.shape))
    shift = (
        row - middle + _between(rest[:, column], row),
        column - middle + _between(rest[row], column),
    )
    moved = np.stack([scipy.ndimage.shift(p, shift, order=1, mode="nearest") for p in told])
    products, squares = (np.sum((moved * p)[:, where], axis=1) for p in (seen, moved))
    gain = (products / np.maximum(squares, FAINT)) ** 2
    misfit = float(np.sqrt(max(rest[row, column], 0) / met))
    return Laid(shift_px=shift, gain=gain.astype(np.float32), misfit=misfit)


def local_shifts(capture: FloatArray, expected: FloatArray, clipped: Mask) -> list[list[int]]:
    """Return (row, column, down, right) in pixels of blocks that lie elsewhere, where they tell."""
    seen, told = (_details(np.sqrt(np.clip(p, 0, 1))) for p in (capture, expected))
    open_ = ~clipped.any(axis=0)
    found = []
    for top in range(0, open_.shape[0] - BLOCK_PX + 1, BLOCK_PX):
        for left in range(0, open_.shape[1] - BLOCK_PX + 1, BLOCK_PX):
            block = np.zeros_like(open_)
            block[top : top + BLOCK_PX, left : left + BLOCK_PX] = True
            rest, met = _rests(seen, told, block & open_)
            row, column = (int(n) for n in np.unravel_index(int(rest.argmin()), rest.shape))
            if met > 0 and rest[row, column] <= ALIKE**2 * met:
                found.append([top, left, row - FARTHEST_PX, column - FARTHEST_PX])
    return found


def _rests(seen: FloatArray, told: FloatArray, where: Mask) -> tuple[NDArray[np.float64], float]:
    """Return what is left of squares for every shift of what is told, at its best gain; and in all.

    Shifts go from -FARTHEST_PX to FARTHEST_PX along both sides.
    """
    size = [scipy.fft.next_fast_len(n + FARTHEST_PX, real=True) for n in where.shape]

    def transform(plane: NDArray[np.floating] | Mask) -> NDArray[np.complex128]:
        return np.asarray(scipy.fft.rfft2(plane.astype(np.float64), size))

    weight = transform(where)
    products, squares = np.zeros_like(weight), np.zeros_like(weight)
    for one, other in zip(seen, told, strict=True):
        products += transform(one * where) * transform(other).conj()
        squares += weight * transform(other * other).conj()
    both = [
        np.roll(scipy.fft.irfft2(p, size), (FARTHEST_PX, FARTHEST_PX), (0, 1))[
            : 2 * FARTHEST_PX + 1, : 2 * FARTHEST_PX + 1
        ]
        for p in (products, squares)
    ]
    met = float(np.sum(np.square(seen, dtype=np.float64) * where))
    return met - both[0] ** 2 / np.maximum(both[1], FAINT), met


def _between(line: NDArray[np.float64], place: int) -> float:
    """Return how far the least of a line lies beside a sample, by the parabola through three."""
    if not 0 < place < line.size - 1:
        return 0.0
    before, here, after = line[place - 1 : place + 2]
    bend = before - 2 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend > 0 else 0.0


def _details(light: FloatArray) -> FloatArray:
    smooth = np.stack([scipy.ndimage.gaussian_filter(p, DETAIL_PX) for p in light])
    return np.asarray(light - smooth, np.float32)

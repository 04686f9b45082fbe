"""Rows that go on at another place: doubts that the pixel data broke in the order of reading.

A stream that lost or gained samples stays shifted to its end. Below the break

    each row goes on where the one above ended: no edge from the last column to the first
    the border of the picture is a seam in one column, which was none above
    a row is the one above it, shifted, at that shift only

Checkerboards, bricks and stars have shifted rows too, but at many shifts, or back again.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.float32]

_JOINED: Final = 0.8
_BROKEN: Final = 0.6
_STRANGE: Final = 0.3
_SCRAMBLED_SHARE: Final = 0.02
_SCRAMBLED_RUN: Final = 4
_LEAST_RUN: Final = 3
_LONGEST_GAP: Final = 4
_SHIFT_MATCH: Final = 0.8
_LEAST_SHIFT: Final = 0.02
_SHIFT_GAIN: Final = 0.15
_ONE_SHIFT: Final = 0.05
_LEAST_ROW_CONTRAST: Final = 1e-3
_SHIFT_ROWS: Final = 24
_LEAST_ROWS: Final = 12
_LEAST_HEIGHT: Final = 0.06
_SAME_SHIFT: Final = 0.03
_BORDER_CELLS: Final = 4
_CLEARLY: Final = 0.7

_MOST_STEP: Final = 12.0
"""In mean steps of a row: an edge counts no more, however strong."""
_SMOOTH_WRAP: Final = 2.0
_SEAM_FALL: Final = 1.0
_SEAM_WRAP: Final = 1.6
_SEAM_RISE: Final = 0.7
_SEAM_SECOND: Final = 0.6
_SEAM_SPREADS: Final = 5.0
_SEAM_ROWS: Final = 4
_SEAM_GUARD: Final = 3


def order_doubt(cells: Cells, wraps: Cells) -> str:
    """Return the evidence that rows lie at another place or in another order; empty for none.

    Args:
        cells: (h, w) light of one colour; white is 1.
        wraps: (h,) steps of light from the end of the row above each row to its beginning.
    """
    steps = _Steps.of(cells, wraps)
    return _shift_doubt(cells, steps) or _skew_doubt(cells, steps) or _scramble_doubt(cells)


def _shift_doubt(cells: Cells, steps: "_Steps") -> str:
    """Find rows that go on at another place than the rows above them ended, to the end."""
    width = cells.shape[1]
    least = _least_rows(len(cells))
    shifts = [(upper, row, _shift(cells[upper], cells[row])) for upper, row in _gaps(cells)]
    breaks = [(upper, row, shift) for upper, row, shift in shifts if shift]
    jumps = [
        (row, shift)
        for upper, row, shift in breaks
        if least <= row <= len(cells) - least
        and steps.below(row)[0] < _SMOOTH_WRAP
        and _moves_border(cells[upper], cells[row], shift)
        and not any(_alike(shift, other, width) for _, at, other in breaks if at != row)
    ]
    jumps = jumps[:1] or steps.seam()
    if not jumps:
        return ""
    ((row, shift),) = jumps
    return (
        f"from {row / len(cells):.0%} of the height on the rows are shifted by "
        f"{shift / width:.0%} of the width: the pixel data are damaged"
    )


def _moves_border(above: NDArray[np.float32], below: NDArray[np.float32], shift: int) -> bool:
    """Return whether the ends of a row are those of the one above it shifted, not as it lies."""
    ends = np.r_[:_BORDER_CELLS, -_BORDER_CELLS:0]
    shifted = np.abs(below - np.roll(above, shift))[ends].mean()
    return bool(shifted < _CLEARLY * np.abs(below - above)[ends].mean())


def _least_rows(height: int) -> int:
    """Return the rows above and below by which a break differs from a part of the picture."""
    return max(_LEAST_ROWS, round(_LEAST_HEIGHT * height))


def _alike(shift: int, other: int, width: int) -> bool:
    """Return whether two shifts are the same or take each other back, as those of patterns do."""
    distances = ((shift - other) % width, (shift + other) % width)
    return min(min(n, width - n) for n in distances) < _SAME_SHIFT * width


def _skew_doubt(cells: Cells, steps: "_Steps") -> str:
    """Find rows that each go on a little further than the one above: a wrong width."""
    if steps.below(0)[0] >= _SMOOTH_WRAP:
        return ""
    rows = [int(n) for n in np.linspace(0, len(cells) - 2, _SHIFT_ROWS)]
    skewed = [_shift(cells[row], cells[row + 1]) for row in rows]
    usual = float(np.median(skewed))
    if usual and np.count_nonzero(np.abs(np.array(skewed) - usual) <= 1) > len(skewed) // 2:
        return (
            f"every row is shifted by about {usual / cells.shape[1]:.1%} of the width against the "
            "one above: the width or the pixel data are damaged"
        )
    return ""


def _scramble_doubt(cells: Cells) -> str:
    """Find rows that are smooth along themselves and have nothing in common with the next."""
    rows = unit_rows(cells[:, :: max(1, cells.shape[1] // 512)])
    alike = np.einsum("yx,yx->y", rows[:-1], rows[1:])
    smooth = np.einsum("yx,yx->y", rows[:, :-1], rows[:, 1:]) > _JOINED
    strange = (alike < _STRANGE) & smooth[:-1] & smooth[1:]
    # a row of squares ends in one such row; where the order is lost they follow each other
    ends = np.nonzero(np.diff(np.concatenate([[False], strange, [False]]).astype(np.int8)))[0]
    lengths = np.diff(ends.reshape(-1, 2), axis=1)
    share = float(lengths[lengths >= _SCRAMBLED_RUN].sum()) / len(strange)
    if share > _SCRAMBLED_SHARE:
        return f"{share:.0%} of the rows do not go with the next: the pixel data are damaged"
    return ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Steps:
    """Steps from each cell to the next in reading order, in mean steps of their row.

    Attributes:
        sums: (h + 1, w) of the rows above; column 0 is the step from the row above.
    """

    sums: NDArray[np.float64]

    @classmethod
    def of(cls, cells: Cells, wraps: Cells) -> "_Steps":
        steps = np.empty(cells.shape, dtype=np.float32)
        np.abs(np.diff(cells, axis=1), out=steps[:, 1:])
        steps[:, 0] = wraps
        usual = steps[:, 1:].mean(axis=1, keepdims=True)
        steps = np.minimum(steps / (usual + np.float32(1e-4)), _MOST_STEP)
        sums = np.zeros((len(cells) + 1, cells.shape[1]))
        np.cumsum(steps, axis=0, dtype=np.float64, out=sums[1:])
        return cls(sums=sums)

    def below(self, row: int) -> NDArray[np.float64]:
        """Return (w,) mean steps of the rows from `row` on."""
        return np.asarray((self.sums[-1] - self.sums[row]) / (len(self.sums) - 1 - row))

    def seam(self) -> list[tuple[int, int]]:
        """Return the row and the column from which on the border of the picture is a seam."""
        height, width = len(self.sums) - 1, self.sums.shape[1]
        least = _least_rows(height)
        rows = np.arange(least, height - least, _SEAM_ROWS)
        if not rows.size:
            return []
        above = self.sums[rows] / rows[:, None]
        below = (self.sums[-1] - self.sums[rows]) / (height - rows)[:, None]
        edge = max(_SEAM_GUARD, round(_LEAST_SHIFT * width))
        rise = (below - above)[:, edge : width - edge]
        fall, wrap = above[:, 0] - below[:, 0], below[:, 0]
        likely = np.minimum(fall, rise.max(axis=1)) * np.sqrt(rows * (height - rows))
        best = int(np.argmax(likely))
        column = int(np.argmax(rise[best]))
        rest = rise[best].copy()
        rest[max(0, column - _SEAM_GUARD) : column + _SEAM_GUARD + 1] = -np.inf
        most = float(rise[best, column])
        clear = (
            fall[best] > _SEAM_FALL
            and wrap[best] < _SEAM_WRAP
            and most > max(_SEAM_RISE, _SEAM_SPREADS * float(rise[best].std()))
            and rest.max() < _SEAM_SECOND * most
        )
        return [(int(rows[best]), column + edge)] if clear else []


def unit_rows(rows: Cells) -> Cells:
    """Return rows of mean 0 and length 1, so that their products are correlations.

    A row of next to no contrast stays short: it goes with none, for or against.
    """
    rows = rows - rows.mean(axis=1, keepdims=True)
    length = np.sqrt(np.einsum("yx,yx->y", rows, rows))[:, None]
    least = np.float32(_LEAST_ROW_CONTRAST * np.sqrt(rows.shape[1]))
    unit: Cells = np.divide(rows, np.maximum(length, least), dtype=np.float32)
    return unit


def _gaps(cells: Cells) -> list[tuple[int, int]]:
    """Return (last row above, first row below) of gaps between rows that go together on both sides.

    What lies in the gap may be a row of two parts, or a few rows of rubbish.
    """
    rows = unit_rows(cells[:, :: max(1, cells.shape[1] // 512)])
    joined = np.einsum("yx,yx->y", rows[:-1], rows[1:]) > _JOINED
    ends = np.nonzero(np.diff(np.concatenate([[False], joined, [False]]).astype(np.int8)))[0]
    runs = ends.reshape(-1, 2)
    runs = runs[runs[:, 1] - runs[:, 0] >= _LEAST_RUN]
    pairs = zip(runs[:-1, 1], runs[1:, 0], strict=True)
    return [
        (int(above), int(below))
        for above, below in pairs
        if below - above <= _LONGEST_GAP and float(rows[above] @ rows[below]) < _BROKEN
    ]


def _shift(above: NDArray[np.float32], below: NDArray[np.float32]) -> int:
    """Return by how many cells a row matches the one above better than as it lies.

    0 stands for no shift, or for several that match alike.
    """
    one, two = unit_rows(np.stack([above, below]))
    match = np.fft.irfft(np.fft.rfft(two) * np.conj(np.fft.rfft(one)), one.size)
    best = int(np.argmax(match))
    clear = match[best] > max(_SHIFT_MATCH, float(one @ two) + _SHIFT_GAIN)
    # a slanting edge moves by a little from row to row too
    is_far = _LEAST_SHIFT * one.size < best < (1 - _LEAST_SHIFT) * one.size
    if not (clear and is_far):
        return 0
    rolled = np.roll(match, -best)
    after, before = (int(np.argmax(np.diff(side) > 0)) for side in (rolled, rolled[::-1]))
    rest = rolled[after + 1 : one.size - before - 1]
    return 0 if rest.size and rest.max() > match[best] - _ONE_SHIFT else best

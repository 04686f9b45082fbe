"""Black and white of a DNG as its tags state them: BlackLevel, its deltas, WhiteLevel.

black of a pixel = BlackLevel, repeated from the first active pixel on
                 + BlackLevelDeltaH of its column + BlackLevelDeltaV of its row

DNG specification 1.7.1, chapter 4. LibRaw repeats the pattern from another pixel if the margins are
odd, keeps the mean of the deltas and one white of all planes.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.files.dng.picture_tags import DngPicture, numbers_of, whole_of

BLACK_REPEAT: Final = 50713
BLACK: Final = 50714
DELTA_H: Final = 50715
DELTA_V: Final = 50716
WHITE: Final = 50717
MAX_REPEAT: Final = 64
MOST_LEVEL: Final = 2.0**32

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BlackMap:
    """Black of every visible pixel.

    Attributes:
        pattern: (r, c, plane) BlackLevel, repeated from the first visible pixel on.
        columns: (w,) added to it.
        rows: (h,) added to it.
    """

    pattern: Floats
    columns: Floats
    rows: Floats

    @property
    def is_of_cells(self) -> bool:
        """Return whether 2x2 levels, or one of each plane, tell all of it."""
        cell = 2 if self.pattern.shape[2] == 1 else 1
        whole = all(cell % n == 0 for n in self.pattern.shape[:2])
        return whole and not self.columns.any() and not self.rows.any()

    def of_rows(self, top: int, bottom: int, plane: int) -> Floats:
        """Return (rows, w) black of rows top..bottom of a plane."""
        pattern = self.pattern[..., plane]
        down = np.arange(top, bottom) % pattern.shape[0]
        across = np.arange(len(self.columns)) % pattern.shape[1]
        return pattern[np.ix_(down, across)] + self.columns + self.rows[top:bottom, None]

    def mean(self, *, mosaic: bool) -> FloatArray:
        """Return mean black: (2, 2) by position in the cell of a mosaic, (plane,) of planes."""
        height, width, planes = len(self.rows), len(self.columns), self.pattern.shape[2]
        if not mosaic:
            rest = _level(self.columns) + _level(self.rows)
            means = [
                _mean_of(self.pattern[..., p], height, width, (0, 0), 1) for p in range(planes)
            ]
            return np.array(np.array(means) + rest, dtype=np.float32)
        cells = [
            [_mean_of(self.pattern[..., 0], height, width, (dy, dx), 2)
             + _level(self.columns[dx::2]) + _level(self.rows[dy::2]) for dx in (0, 1)]
            for dy in (0, 1)
        ]  # fmt: skip
        return np.array(cells, dtype=np.float32)


def _level(black: Floats) -> np.float64:
    """Return the mean of what rows or columns have; 0 where there are none."""
    return np.float64(black.mean() if black.size else 0)


def _mean_of(
    pattern: Floats, height: int, width: int, first: tuple[int, int], step: int
) -> np.float64:
    down = np.bincount(np.arange(first[0], height, step) % pattern.shape[0], minlength=len(pattern))
    across = np.bincount(
        np.arange(first[1], width, step) % pattern.shape[1], minlength=pattern.shape[1]
    )
    weights = np.outer(down, across)
    return np.float64(np.sum(pattern * weights) / max(weights.sum(), 1))


def black_map(
    picture: DngPicture, shape: tuple[int, int], offset: tuple[int, int]
) -> tuple[BlackMap, list[str]]:
    """Return black of every visible pixel and what is wrong with its tags.

    Args:
        picture: The sensor picture.
        shape: (h, w) of the visible pixels.
        offset: Row and column of the first visible pixel from the first active one.
    """
    pattern, notes = _pattern(picture)
    pattern = np.roll(pattern, (-offset[0], -offset[1]), axis=(0, 1))
    top, left, bottom, right = picture.active_area
    added = []
    for tag, name, whole, first, length in (
        (DELTA_V, "BlackLevelDeltaV", bottom - top, offset[0], shape[0]),
        (DELTA_H, "BlackLevelDeltaH", right - left, offset[1], shape[1]),
    ):
        values = _levels(picture, tag)
        fits = 0 < values.size == whole and bool(np.isfinite(values).all())
        if values.size and not fits:
            notes.append(
                f"{name} has {len(values)} values for {whole}, or one that is no number: the "
                "header is damaged"
            )
        added.append(values[first : first + length] if fits else np.zeros(length))
    return BlackMap(pattern=pattern, rows=added[0], columns=added[1]), notes


def _levels(picture: DngPicture, tag: int) -> Floats:
    """Return the numbers of a tag, NaN for those that no level can be."""
    values = np.array(numbers_of(picture.directory, tag), dtype=np.float64)
    values[~(np.abs(values) <= MOST_LEVEL)] = np.nan
    return values


def _pattern(picture: DngPicture) -> tuple[Floats, list[str]]:
    """Return (r, c, plane) BlackLevel from the first active pixel on, in scan order."""
    values = _levels(picture, BLACK)
    repeat = whole_of(picture.directory, BLACK_REPEAT)
    rows, cols = repeat if len(repeat) == 2 else (1, 1)
    planes = picture.planes
    if not values.size:
        return np.zeros((1, 1, planes)), []
    believable = 0 < rows <= MAX_REPEAT and 0 < cols <= MAX_REPEAT and np.isfinite(values).all()
    if believable and values.size == rows * cols * planes:
        return values.reshape(rows, cols, planes), []
    if np.isfinite(values).all() and (values == values[0]).all():
        return np.full((1, 1, planes), values[0]), []
    finite = values[np.isfinite(values)]
    return np.full((1, 1, planes), finite.mean() if finite.size else 0.0), [
        f"BlackLevel has {values.size} values for {rows}x{cols} pixels of {planes} sample(s), "
        "their mean is taken: the header is damaged"
    ]


def white_levels(picture: DngPicture) -> FloatArray:
    """Return (plane,) white: WhiteLevel, else 1 of float samples and all bits of others."""
    whites = [n for n in numbers_of(picture.directory, WHITE) if 0 < n <= MOST_LEVEL]
    default = 1.0 if picture.is_float else 2.0 ** min(picture.bits, 32) - 1
    if len(whites) != picture.planes:
        whites = [max(whites, default=default)] * picture.planes
    return np.array(whites, dtype=np.float32)

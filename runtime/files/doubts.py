"""Doubts of a decode that is possible but not likely: each one sentence that names the damage.

    levels    samples above white, below black, far above black; masked pixels beside black
    pattern   two greens that disagree
    lost      samples that are 0 from the middle of a row on
    tiles     an edge along the border of one (tile_edges)
    order     rows that go on shifted (row_order), rows of pure noise, rims without light

`camkit.runtime.files.raw_checks` refuses what cannot be; this file only warns, since a photograph
may be odd. Every limit lies beyond what the sound RAW files at hand and simulated captures show.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.cfa import CfaPattern
from camkit.runtime.capture import Capture
from camkit.runtime.files.order.row_order import order_doubt
from camkit.runtime.files.order.tile_edges import TileGrid, tile_doubt
from camkit.runtime.files.raw_checks import Levels, Samples

if TYPE_CHECKING:
    from camkit.haze import Haze

ABOVE_WHITE: Final = 1.02
ABOVE_WHITE_SHARE: Final = 2e-5
LEAST_ABOVE_WHITE: Final = 20
PILE_SHARE: Final = 0.5
DARKEST_SHARE: Final = 1e-3
FAR_ABOVE_BLACK: Final = 0.08
NOTHING_DARK: Final = "nothing is darker than"
LEAST_CONTRAST: Final = 0.2
FAR_BELOW_BLACK: Final = 0.02
BELOW_BLACK: Final = 0.005
NEVER_BRIGHT: Final = 0.03
MASKED_SPREAD: Final = 0.01
MASKED_OFFSET: Final = 0.005
GREEN_OFFSET: Final = 0.15
LEAST_GREEN: Final = 0.01
BLACKS_APART: Final = 0.04
SWAPPED_GREENS: Final = 2.5
_GREEN_SQUARE: Final = 16
LEAST_LIGHT: Final = 0.01
LEAST_BREAK_PX: Final = 8
LEAST_SIDE_PX: Final = 64
"""Smaller pictures show too little of themselves."""

_SAMPLED_ROWS: Final = 256
_COLUMN_STEP: Final = 3
_CELL_COLUMNS: Final = 1024
_BAND_CELLS: Final = 32
_NOISE_RATIO: Final = 0.8
_NOISE_LEVEL: Final = 0.05
_LAGS: Final = 12
_DARK_EDGE_CELLS: Final = 4
_DARK_EDGE_LEVEL: Final = 0.01

Cells = NDArray[np.float32]


def find_doubts(
    samples: Samples,
    levels: Levels,
    cfa: CfaPattern | None,
    masked: Sequence[Samples] = (),
    grid: TileGrid | None = None,
) -> list[str]:
    """Return the reasons to doubt a decode; none for a sound photograph.

    Args:
        samples: (h, w) mosaic or (c, h, w) planes, unsigned integers.
        levels: Black and white level of the same file.
        cfa: Pattern of a mosaic; None for planes.
        masked: Areas of the sensor that see no light, where the file has them.
        grid: Tiles that the file stores, if it does.
    """
    if min(samples.shape[-2:]) < LEAST_SIDE_PX:
        return []
    cells = _cells(samples, levels, cfa)
    doubts = (
        *_level_doubts(samples, levels),
        _masked_doubt(masked, levels),
        _green_doubt(samples, levels, cfa),
        order_doubt(cells, _wraps(samples, levels, cfa)),
        _lost_doubt(samples, levels),
        tile_doubt(cells, grid, (2 if cfa else 1, _column_step(samples, cfa))) if grid else "",
        _noise_doubt(cells),
        _edge_doubt(cells),
    )
    return [doubt for doubt in doubts if doubt]


def notes_behind(capture: Capture, haze: "Haze") -> list[str]:
    """Return the notes of a capture without the doubt about its black that a haze explains.

    Haze takes light from bright parts into dark ones: no sample need be darker than the share of
    the mean that the optics throw far from their peaks.

    Args:
        capture: With notes of `find_doubts` among others.
        haze: Of the optics that it was taken with.
    """
    notes = list(capture.notes)
    if not any(note.startswith(NOTHING_DARK) for note in notes):
        return notes
    some = _thinned(capture.samples)
    black = float(capture.black_level.mean())
    low = float(np.quantile(some, DARKEST_SHARE)) - black
    if low > haze.most_share * (float(some.mean()) - black):
        return notes
    return [note for note in notes if not note.startswith(NOTHING_DARK)]


def is_noise(samples: Samples, levels: Levels, cfa: CfaPattern | None) -> bool:
    """Return whether most of a picture is noise of a large part of its range, white left aside.

    So damaged streams decode. Arguments as for `find_doubts`.
    """
    if min(samples.shape[-2:]) < LEAST_SIDE_PX:
        return False
    widened = replace(levels, white=float(max(samples.max(), levels.black.max() + 1)))
    return _noise_share(_cells(samples, widened, cfa)) > 0.5


def _level_doubts(samples: Samples, levels: Levels) -> list[str]:
    black, span = float(levels.black.mean()), levels.white - float(levels.black.mean())
    low, high = (
        (float(value) - black) / span
        for value in np.quantile(_thinned(samples), (DARKEST_SHARE, 1 - DARKEST_SHARE))
    )
    top = (float(samples.max()) - black) / span
    doubts = [_above_white_doubt(samples, levels)]
    spread = float(np.ptp(levels.black))
    if levels.black.ndim == 2 and spread > BLACKS_APART * span:
        doubts.append(
            f"the black levels of the CFA differ by {spread:g}: the black level is damaged "
            f"(set it with {option_text('black_level')})"
        )
    if low > FAR_ABOVE_BLACK and high - low > LEAST_CONTRAST:
        doubts.append(
            f"{NOTHING_DARK} {low:.0%} of the range above black {black:g}: a "
            f"bright scene, fog, veiling glare, or a stated black level that is too low "
            f"(set it with {option_text('black_level')})"
        )
    middle, least = float(np.median(_thinned(samples))), float(levels.black.min())
    if middle < least - BELOW_BLACK * span:
        doubts.append(
            f"half of the samples lie at or below {middle:g}, black is {least:g}: the black level "
            f"or the pixel data are damaged (set it with {option_text('black_level')})"
        )
    elif low < -FAR_BELOW_BLACK:
        doubts.append(
            f"the darkest samples lie {-low:.0%} of the range below black {black:g}: the black "
            f"level or the pixel data are damaged (set it with {option_text('black_level')})"
        )
    if top < NEVER_BRIGHT:
        doubts.append(
            f"nothing is brighter than {top:.1%} of white {levels.white:g}: a dark picture, or a "
            f"stated white level that is too high (set it with {option_text('white_level')})"
        )
    return doubts


def _thinned(samples: NDArray[Any]) -> NDArray[Any]:
    """Return some samples of every part of a picture."""
    step = max(1, samples.shape[-2] // _SAMPLED_ROWS)
    return samples[..., step // 2 :: step, ::_COLUMN_STEP]


def _above_white_doubt(samples: Samples, levels: Levels) -> str:
    """Return a doubt of samples that go on beyond white, not of those that pile up above it."""
    top = int(samples.max())
    if top <= levels.white * ABOVE_WHITE:
        return ""
    count = int(np.count_nonzero(samples > levels.white * ABOVE_WHITE))
    piled = int(np.count_nonzero(samples >= 0.99 * top))
    if count < max(LEAST_ABOVE_WHITE, ABOVE_WHITE_SHARE * samples.size):
        return ""
    if piled > PILE_SHARE * count:
        return ""
    return (
        f"{count} samples lie above white {levels.white:g}, up to {top}: the white level or the "
        f"pixel data are damaged (set it with {option_text('white_level')})"
    )


def _masked_doubt(masked: Sequence[Samples], levels: Levels) -> str:
    """Compare black with pixels that see no light, where these are quiet."""
    black, span = float(levels.black.mean()), levels.white - float(levels.black.mean())
    for area in masked:
        if area.size < LEAST_SIDE_PX**2:
            continue
        low, middle, high = np.quantile(area, (0.05, 0.5, 0.95))
        if high - low < MASKED_SPREAD * span and abs(middle - black) > MASKED_OFFSET * span:
            return (
                f"black is {black:g}, the masked pixels of the sensor lie at {middle:g}: the black "
                f"level is damaged (set it with {option_text('black_level')})"
            )
    return ""


def _green_doubt(samples: Samples, levels: Levels, cfa: CfaPattern | None) -> str:
    """Compare the two greens of the cells, which see the same light."""
    if cfa is None:
        return ""
    height, width = (side // 2 * 2 for side in samples.shape)
    step = 2 * max(1, height // 2 // _SAMPLED_ROWS)
    greens = _green_places(cfa)
    pair, others = (
        [
            _averages(samples[dy:height:step, dx:width:2], float(levels.black[dy, dx]))
            for dy, dx in places
        ]
        for places in (greens, [place for place in np.ndindex(2, 2) if place not in greens])
    )
    difference, level = np.median(np.abs(pair[0] - pair[1])), np.median(pair[0] + pair[1]) / 2
    bias = abs(float(np.median(pair[0] - pair[1])))
    bright = level > LEAST_GREEN * (levels.white - float(levels.black.mean()))
    # red and blue that go together better than the greens are the greens
    swapped = difference > GREEN_OFFSET * level and difference > SWAPPED_GREENS * np.median(
        np.abs(others[0] - others[1])
    )
    biased = bias > GREEN_OFFSET * level and bias > 0.5 * difference
    if bright and (biased or swapped):
        share = (bias if biased else float(difference)) / level
        return f"the two greens of the CFA {cfa} differ by {share:.0%}: the CFA is damaged"
    return ""


def _averages(plane: Samples, black: float) -> Cells:
    """Return light of one place in the cell, averaged over squares, so that fine patterns go.

    Stripes along a diagonal of the cell are seen by one green and not by the other.
    """
    high, wide = (side // _GREEN_SQUARE for side in plane.shape)
    squares = plane[: high * _GREEN_SQUARE, : wide * _GREEN_SQUARE]
    squares = squares.reshape(high, _GREEN_SQUARE, wide, _GREEN_SQUARE)
    return np.asarray(squares.mean(axis=(1, 3), dtype=np.float32) - np.float32(black))


def _cells(samples: Samples, levels: Levels, cfa: CfaPattern | None) -> Cells:
    """Return (h, w) float32 green light of the cells, or the middle plane; white is 1.

    Columns between are left out of a wide picture.
    """
    cells: Cells
    if cfa is None:
        plane = samples[samples.shape[0] // 2]
        cells = plane[:, :: _column_step(samples, cfa)].astype(np.float32)
    else:
        height, width = (side // 2 * 2 for side in samples.shape)
        step = _column_step(samples, cfa)
        first, second = _green_places(cfa)
        cells = samples[first[0] : height : 2, first[1] : width : step].astype(np.float32)
        cells += samples[second[0] : height : 2, second[1] : width : step]
        cells *= np.float32(0.5)
    black = float(levels.black.mean())
    cells -= np.float32(black)
    cells *= np.float32(1 / (levels.white - black))
    return cells


def _column_step(samples: Samples, cfa: CfaPattern | None) -> int:
    """Return the pixels from one cell to the next in a row."""
    pixels = 1 if cfa is None else 2
    return pixels * max(1, int(samples.shape[-1]) // pixels // _CELL_COLUMNS)


def _wraps(samples: Samples, levels: Levels, cfa: CfaPattern | None) -> Cells:
    """Return (h,) steps from the end of each row of cells to the next, between samples alike.

    Where a stream broke, the end of a row and the next are neighbours in what was photographed;
    those of a mosaic that are two samples apart then have one colour.
    """
    plane, period = (samples, 2) if cfa is not None else (samples[len(samples) // 2], 1)
    ends, starts = plane[:-1, -period:].astype(np.float32), plane[1:, :period].astype(np.float32)
    steps = np.abs(starts - ends).mean(axis=1) / (levels.white - float(levels.black.mean()))
    steps = np.concatenate([steps[:1], steps])
    return steps if cfa is None else steps[: len(steps) // 2 * 2].reshape(-1, 2).mean(axis=1)


def _green_places(cfa: CfaPattern) -> list[tuple[int, int]]:
    return [divmod(n, 2) for n, letter in enumerate(cfa) if letter == "G"]


def _lost_doubt(samples: Samples, levels: Levels) -> str:
    """Find rows of zeros that begin or end in the middle of a row of light: data that were lost."""
    plane = samples if samples.ndim == 2 else samples[len(samples) // 2]
    dark = np.flatnonzero(~plane.any(axis=1))
    if not dark.size:
        return ""
    runs = np.split(dark, np.flatnonzero(np.diff(dark) > 1) + 1)
    for run in runs:
        above, below = plane[max(run[0] - 2, 0) : run[0]], plane[run[-1] + 1 : run[-1] + 3]
        if _breaks_off(above, levels) or _breaks_off(below[::-1], levels):
            return f"{run.size} rows and a part of one are 0: the pixel data are damaged"
    return ""


def _breaks_off(rows: Samples, levels: Levels) -> bool:
    """Return whether one part of the last row is 0, and light both beside it and in the first.

    So a stream ends; an edge of what is photographed lies at other places in the next row.
    """
    width = rows.shape[1]
    if len(rows) < 2 or not rows[-1].any():
        return False
    lit = np.flatnonzero(rows[-1])
    gaps = np.diff(np.append(lit, lit[0] + width))  # some cameras turn their rows
    longest = int(np.argmax(gaps))
    gap = np.zeros(width, dtype=bool)
    gap[np.arange(lit[longest] + 1, lit[longest] + gaps[longest]) % width] = True
    black = float(levels.black.mean())
    least = black + LEAST_LIGHT * (levels.white - black)
    sides = rows[-1][~gap], rows[0][gap]
    return all(len(side) >= LEAST_BREAK_PX and float(np.median(side)) > least for side in sides)


def _noise_doubt(cells: Cells) -> str:
    share = _noise_share(cells)
    return f"{share:.0%} of the rows are noise: the pixel data are damaged" if share else ""


def _noise_share(cells: Cells) -> float:
    """Return the share of bands in which a cell has nothing in common with those around it."""
    half, step = cells.shape[1] // 2, max(1, cells.shape[1] // 512)
    noisy = []
    for top in range(0, len(cells) - _BAND_CELLS + 1, _BAND_CELLS):
        rows = cells[top : top + _BAND_CELLS : 2]
        here, distant = rows[:, : half - _LAGS : step], rows[:, half : 2 * half - _LAGS : step]
        # a fine pattern has something in common with itself one period on, noise never has
        next_rows = cells[top + 1 : top + _BAND_CELLS : 2, : half - _LAGS : step]
        others = [rows[:, lag : half - _LAGS + lag : step] for lag in range(1, _LAGS + 1)]
        near = min(float(np.median(np.abs(other - here))) for other in (*others, next_rows))
        far = float(np.median(np.abs(distant - here)))
        noisy.append(near > max(_NOISE_LEVEL, _NOISE_RATIO * far))
    return float(np.mean(noisy)) if noisy else 0.0


def _edge_doubt(cells: Cells) -> str:
    """Find a dark rim: masked pixels that were taken for a part of the picture."""
    for name, picture in (("left", cells.T), ("right", cells.T[::-1]), ("upper", cells)):
        step = max(1, picture.shape[1] // 512)
        level = np.quantile(picture[: len(picture) // 4, ::step], 0.9, axis=1)
        dark = int(np.argmax(level > _DARK_EDGE_LEVEL))
        inner = level[dark + 2 : dark + 2 + _DARK_EDGE_CELLS]
        if dark >= _DARK_EDGE_CELLS and inner.size and inner.min() > 3 * _DARK_EDGE_LEVEL:
            return (
                f"the {name} {2 * dark} columns or rows see no light: the active area of the "
                "header is damaged"
            )
    return ""

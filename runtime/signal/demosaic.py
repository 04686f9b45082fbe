"""Full colour planes from a Bayer mosaic, linear float32 in and out; nothing is clipped.

fast     Malvar, He and Cutler 2004: gradient-corrected linear interpolation with 5x5 kernels.
quality  after Menon, Andriani and Calvagno 2007: green along edges, refined afterwards from the
         colour differences; in `camkit.runtime.signal.directional`.

Both look at a bounded neighbourhood (`DEMOSAIC_MARGIN_PX`), so rows [t, b) demosaicked with that
much context equal the same rows of the whole picture bit for bit; with "quality" columns too. At
the border the mosaic is mirrored about its outermost pixels (reflect 101), which keeps the CFA
phase; a single row or column is repeated.

The exact form of fast: out[c] at a pixel is the sum over the 5x5 neighbourhood of
`MALVAR_KERNELS[name]` times the mosaic, name chosen by the pixel's own colour and the wanted one:

    own colour wanted                       the sample itself
    green wanted at red or blue             "green"
    red wanted at green of a red row        "along_row"     (likewise blue in a blue row)
    red wanted at green of a blue row       "along_column"  (likewise blue in a red row)
    red wanted at blue, blue at red         "diagonal"

References: Malvar, He, Cutler, "High-quality linear interpolation for demosaicing of
Bayer-patterned color images", ICASSP 2004, figure 2.
"""

from typing import Final, Literal

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.runtime.signal.directional import DIRECTIONAL_REACH_PX, demosaic_tile

DemosaicMethod = Literal["fast", "quality"]

DEMOSAIC_MARGIN_PX: Final[dict[DemosaicMethod, int]] = {
    "fast": 2,
    "quality": DIRECTIONAL_REACH_PX,
}
TILE_PX: Final[dict[DemosaicMethod, tuple[int, int]]] = {
    "fast": (64, 1 << 30),
    "quality": (128, 512),
}
"""Rows and columns of what is demosaicked at once, which fits into the cache."""
Box = tuple[int, int, int, int]
"""(top, left, bottom, right) in pixels."""


def _kernel(rows: list[list[float]]) -> FloatArray:
    return np.array(rows, dtype=np.float32) / np.float32(8)


_ALONG_ROW: Final = _kernel(
    [[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]
)

MALVAR_KERNELS: Final[dict[str, FloatArray]] = {
    "green": _kernel(
        [[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]
    ),
    "along_row": _ALONG_ROW,
    "along_column": np.ascontiguousarray(_ALONG_ROW.T),
    "diagonal": _kernel(
        [
            [0, 0, -1.5, 0, 0],
            [0, 2, 0, 2, 0],
            [-1.5, 0, 6, 0, -1.5],
            [0, 2, 0, 2, 0],
            [0, 0, -1.5, 0, 0],
        ]
    ),
}


def demosaic(mosaic: FloatArray, cfa: CfaPattern, method: DemosaicMethod = "fast") -> FloatArray:
    """Interpolate the missing colours of a Bayer mosaic.

    Args:
        mosaic: (h, w) float32, linear; white-balanced, so that the colours resemble each other.
        cfa: Letters of the 2x2 cell at pixel (0, 0).
        method: "fast" or "quality".

    Returns:
        (3, h, w) float32, R, G, B; the samples themselves are kept exactly.

    Raises:
        ContractError: If the mosaic is not (h, w) float32, or the method or CFA is unknown.
    """
    if mosaic.ndim != 2 or mosaic.dtype != np.float32 or 0 in mosaic.shape:
        raise ContractError(f"mosaic must be (h, w) float32; got {mosaic.dtype} {mosaic.shape}")
    if cfa not in CFA_PATTERNS:
        raise ContractError(f"CFA must be one of {', '.join(CFA_PATTERNS)}; got {cfa!r}")
    if method not in DEMOSAIC_MARGIN_PX:
        raise ContractError(f"demosaic must be fast or quality; got {method!r}")
    height, width = mosaic.shape
    return demosaic_part(mosaic, cfa, method, (0, 0, height, width))


def demosaic_part(
    mosaic: FloatArray, cfa: CfaPattern, method: DemosaicMethod, box: Box
) -> FloatArray:
    """Return what `demosaic` makes of a part, (3, h, w) as `box`; the rest is looked at alone.

    Args:
        mosaic: As `demosaic`.
        cfa: Letters of the 2x2 cell at pixel (0, 0).
        method: "fast" or "quality".
        box: (top, left, bottom, right) in pixels of the mosaic.
    """
    top, left, bottom, right = box
    planes = np.empty((3, bottom - top, right - left), dtype=np.float32)
    make = _malvar_tile if method == "fast" else _directional_tile
    rows, columns = TILE_PX[method]
    for y in range(top, bottom, rows):
        for x in range(left, right, columns):
            tile = y, x, min(y + rows, bottom), min(x + columns, right)
            planes[:, y - top : tile[2] - top, x - left : tile[3] - left] = make(mosaic, cfa, tile)
    return planes


def apply_gains(mosaic: FloatArray, cfa: CfaPattern, gains: tuple[float, float, float]) -> None:
    """Multiply every sample of a mosaic by the gain of its colour, in place."""
    for dy, row in enumerate(cfa_channels(cfa)):
        for dx, color in enumerate(row):
            if gains[color] != 1:
                mosaic[dy::2, dx::2] *= np.float32(gains[color])


def shift_rows(cfa: CfaPattern, rows: int) -> CfaPattern:
    """Return the CFA letters of the cell that starts `rows` below the first."""
    if rows % 2 == 0:
        return cfa
    swapped = cfa[2:] + cfa[:2]
    return next(pattern for pattern in CFA_PATTERNS if pattern == swapped)


def _directional_tile(mosaic: FloatArray, cfa: CfaPattern, box: Box) -> FloatArray:
    """Return a tile by "quality": with its surroundings, from red pixels to red pixels."""
    red = next((y, x) for y, row in enumerate(cfa_channels(cfa)) for x in (0, 1) if row[x] == 0)
    first = [begin - (begin - place) % 2 for begin, place in zip(box[:2], red, strict=True)]
    last = [end - 1 + (end - 1 - begin) % 2 for begin, end in zip(first, box[2:], strict=True)]
    reach = DIRECTIONAL_REACH_PX
    before = [max(reach - begin, 0) for begin in first]
    after = [max(end + reach + 1 - side, 0) for end, side in zip(last, mosaic.shape, strict=True)]
    there = [
        slice(max(begin - reach, 0), end + reach + 1)
        for begin, end in zip(first, last, strict=True)
    ]
    samples = cv2.copyMakeBorder(
        mosaic[there[0], there[1]], before[0], after[0], before[1], after[1], cv2.BORDER_REFLECT_101
    )
    planes = demosaic_tile(np.asarray(samples, np.float32))
    top, left = (begin - start for begin, start in zip(box[:2], first, strict=True))
    return planes[:, top : top + box[2] - box[0], left : left + box[3] - box[1]]


def _malvar_tile(mosaic: FloatArray, cfa: CfaPattern, box: Box) -> FloatArray:
    """Return a tile by "fast", made of whole rows."""
    top, left, bottom, right = box
    margin = DEMOSAIC_MARGIN_PX["fast"]
    first = max(top - margin, 0)
    planes = _malvar(mosaic[first : bottom + margin], shift_rows(cfa, first))
    return planes[:, top - first : bottom - first, left:right]


def _malvar(mosaic: FloatArray, cfa: CfaPattern) -> FloatArray:
    filtered = {
        name: cv2.filter2D(mosaic, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT_101)
        for name, kernel in MALVAR_KERNELS.items()
    }
    planes = np.empty((3, *mosaic.shape), dtype=np.float32)
    cells = cfa_channels(cfa)
    for dy, row in enumerate(cells):
        for dx, channel in enumerate(row):
            at = (slice(dy, None, 2), slice(dx, None, 2))
            for target in range(3):
                name = _kernel_name(channel, target, row)
                planes[target][at] = (mosaic if name is None else filtered[name])[at]
    return planes


def _kernel_name(channel: int, target: int, row: tuple[int, int]) -> str | None:
    """Return the name of the kernel of a pixel of colour `channel` in a row of colours `row`."""
    if channel == target:
        return None
    if target == 1:
        return "green"
    if channel == 1:
        return "along_row" if target in row else "along_column"
    return "diagonal"

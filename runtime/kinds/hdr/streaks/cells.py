"""A capture in cells: the mean of every colour's samples in 2 x 2 pixels, and in 4 x 4.

A mosaic is seen by each colour on a lattice of its own: red, say, samples the corner of every
cell. A cell stands for the light in a square of its pitch about the middle of its samples, so each
colour has cells at places of its own (`Lattice.offset_px`), and a kernel as those samples see it.

    mosaic or planes -> cells of 2 px -> cells of 4 px
    dense kernel     -> kernel of cells of 2 px -> of 4 px
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.streaks.shapes import pooled

COLOURS: Final = 3
PITCH_PX: Final = 2
"""Of the cells of a capture."""
TILE_CELLS: Final = 64
"""Coarser cells on a side of the squares in which is looked for what clipped."""
Sites = tuple[tuple[int, int], ...]
"""(y, x) of a colour's samples in a cell of 2 x 2."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """The light of a capture in cells, one plane per colour; 1.0 is where samples clip.

    Attributes:
        light: (3, h, w) float32: mean of the samples that did not clip, in cells with any.
        clipped: (3, h, w) float32: share of the samples that clipped.
        pitch_px: Side of a cell.
        offset_px: (y, x) of the middle of the first cell, for every colour.
        pixels: (1, h, w) of a mosaic or (3, h, w) of planes, uint8: which samples of cells of 2 px
            clipped, the one at (y, x) of a cell as bit 2 y + x. Of coarser cells (0, h, w).
    """

    light: FloatArray
    clipped: FloatArray
    pitch_px: int
    offset_px: tuple[tuple[float, float], ...]
    pixels: NDArray[np.uint8]

    @property
    def unclipped(self) -> FloatArray:
        """Return the light of what did not clip, spread over its cell."""
        return self.light * (1 - self.clipped) if self.clipped.any() else self.light


def sample_sites(cfa: CfaPattern | None) -> tuple[Sites, ...]:
    """Return the sites of each colour's samples in a cell; everywhere in full planes."""
    every = tuple((y, x) for y in (0, 1) for x in (0, 1))
    if cfa is None:
        return (every,) * COLOURS
    letters = cfa_channels(cfa)
    return tuple(tuple(s for s in every if letters[s[0]][s[1]] == c) for c in range(COLOURS))


def cells_of(samples: FloatArray, clipped: NDArray[np.bool_], sites: Sequence[Sites]) -> Cells:
    """Return the cells of 2 x 2 pixels of a capture; a last odd row or column is left out.

    Args:
        samples: (1, h, w) mosaic or (3, h, w) planes, linear, float32, every colour clips at 1.
        clipped: The same shape.
        sites: Of `sample_sites`.

    Raises:
        ContractError: If the shapes are not as stated, or a side is shorter than a cell.
    """
    if samples.ndim != 3 or samples.shape[0] not in (1, COLOURS) or samples.shape != clipped.shape:
        raise ContractError(
            f"samples must be (1 or 3, h, w) with a mask; got {samples.shape}, {clipped.shape}"
        )
    height, width = samples.shape[1] // 2, samples.shape[2] // 2
    if not (height and width):
        raise ContractError(f"a capture needs 2 px on each side; got {samples.shape[1:]}")
    light = np.zeros((COLOURS, height, width), np.float32)
    share = np.zeros_like(light)
    any_clipped = bool(clipped.any())
    for colour, places in enumerate(sites):
        plane = min(colour, samples.shape[0] - 1)
        for y, x in places:
            at = (plane, slice(y, 2 * height, 2), slice(x, 2 * width, 2))
            if any_clipped:
                light[colour] += np.where(clipped[at], 0, samples[at])
                share[colour] += clipped[at]
            else:
                light[colour] += samples[at]
        share[colour] /= len(places)
        light[colour] /= len(places)
    return Cells(
        light=_unclipped_mean(light, share) if any_clipped else light,
        clipped=share,
        pitch_px=PITCH_PX,
        offset_px=tuple(_middle(places) for places in sites),
        pixels=_pixels(clipped[:, : 2 * height, : 2 * width]),
    )


def coarser(cells: Cells) -> Cells:
    """Return cells of twice the pitch; a last odd row or column is left out.

    Raises:
        ContractError: If a side is shorter than such a cell.
    """
    if min(cells.light.shape[1:]) < 2:
        raise ContractError(f"cells need two on each side; got {cells.light.shape[1:]}")
    light = pooled(cells.light)
    share = np.zeros(light.shape, np.float32)  # takes no memory until it is written to
    for top in range(0, light.shape[1], TILE_CELLS):
        for left in range(0, light.shape[2], TILE_CELLS):
            there = np.s_[:, top : top + TILE_CELLS, left : left + TILE_CELLS]
            fine = np.s_[:, 2 * top : 2 * (top + TILE_CELLS), 2 * left : 2 * (left + TILE_CELLS)]
            clipped = cells.clipped[fine]
            if clipped.any():
                share[there] = pooled(clipped)
                light[there] = _unclipped_mean(
                    pooled(cells.light[fine] * (1 - clipped)), share[there]
                )
    half = cells.pitch_px / 2
    return Cells(
        light=light,
        clipped=share,
        pitch_px=2 * cells.pitch_px,
        offset_px=tuple((y + half, x + half) for y, x in cells.offset_px),
        pixels=np.zeros((0, *share.shape[1:]), np.uint8),
    )


def cell_kernel(kernel: FloatArray, sites: Sites) -> FloatArray:
    """Return the kernel of a cell of even light on the samples of a colour, per cell of 2 px.

    Args:
        kernel: (n, n) in pixels, n odd.
        sites: Samples of the colour in a cell.

    Returns:
        (m, m), m odd: light at a cell, m // 2 cells beside the one that shines.
    """
    middle = _middle(sites)
    taps = np.zeros((5, 5))
    for y, x in sites:
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                # a pixel of the shining cell, seen from the sample
                inside = _overlap(y + dy - middle[0]) * _overlap(x + dx - middle[1])
                taps[2 + dy, 2 + dx] += inside / len(sites)
    return _every_second(_spread(kernel, taps))


def coarser_kernel(kernel: FloatArray) -> FloatArray:
    """Return the kernel of cells of twice the pitch."""
    hat = np.array([0.5, 1, 0.5])
    return _every_second(_spread(kernel, np.outer(hat, hat)))


def _pixels(clipped: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the samples of every cell of 2 x 2 as bits."""
    code = np.zeros((clipped.shape[0], clipped.shape[1] // 2, clipped.shape[2] // 2), np.uint8)
    for bit in range(PITCH_PX**2):
        y, x = divmod(bit, PITCH_PX)
        code |= clipped[:, y::2, x::2].astype(np.uint8) << np.uint8(bit)
    return code


def _middle(sites: Sites) -> tuple[float, float]:
    y, x = np.mean(sites, axis=0)
    return float(y), float(x)


def _overlap(distance_px: float) -> float:
    """Return the share of a pixel that lies in a square of 2 px, `distance_px` from its middle."""
    return float(np.clip(1.5 - abs(distance_px), 0, 1))


def _spread(kernel: FloatArray, taps: NDArray[np.float64]) -> FloatArray:
    """Convolve with a few taps; the result is as much larger as they are."""
    half = taps.shape[0] // 2
    padded = np.pad(kernel, 2 * half)
    side = kernel.shape[0] + 2 * half
    out = np.zeros((side, side))
    for y, x in np.argwhere(taps):
        top, left = 2 * half - y, 2 * half - x
        out += taps[y, x] * padded[top : top + side, left : left + side]
    return out.astype(np.float32)


def _every_second(kernel: FloatArray) -> FloatArray:
    middle = kernel.shape[0] // 2
    first = middle % 2
    return np.ascontiguousarray(kernel[first::2, first::2])


def _unclipped_mean(light: FloatArray, clipped: FloatArray) -> FloatArray:
    """Return the mean of what did not clip from its mean over all; 0 where all did."""
    share = 1 - clipped
    return np.divide(light, share, out=np.zeros_like(light), where=share > 0)

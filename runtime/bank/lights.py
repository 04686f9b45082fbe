"""Lights that clip the sensor, explained where they are: what a linear filter cannot know.

    clipped samples -> windows around them -> rounds of Richardson-Lucy -> faded away from them

Farther from the lights nothing is gained by an explanation, and detail is lost: Richardson-Lucy in
few rounds leaves more unexplained than the noise (measured by tools/lights/clipped.py at 2a55aa66).
Where few samples are clipped, small windows do: most of the kernel must fit one, and its OTF there
is the block's at every second, third or fourth frequency.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Wiener
from camkit.runtime.bank.blocks import Block, taper_edges
from camkit.runtime.bank.richardson_lucy import richardson_lucy
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer

SHRINKS: Final = (4, 3, 2)
"""Sides of windows, as parts of a block's side."""

Mask = NDArray[np.bool_]
Cells = tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowRule:
    """The rule for windows that explain lights.

    Attributes:
        margin_px: Surroundings that a window sees around the samples it explains.
        ring_px: Of the margin is tapered: a window is no periodic picture.
        most_reach_px: Farther from clipped samples no window explains anything.
        kernel_share: Of a kernel's side must fit a window; the rest wraps around.
        sample_cost: Of a sample in a window against one in a block (measured).
        extra: Samples that take as long as what every window takes besides its own (measured).
    """

    margin_px: int
    ring_px: int
    most_reach_px: int
    kernel_share: float
    sample_cost: float
    extra: int


RULES: Final = {
    # The rest, some hundredths of its light, wraps around to where the explanation no longer
    # counts; half as much was no better (tools/lights/clipped.py at 2a55aa66).
    "half_kernel": WindowRule(
        margin_px=20,
        ring_px=8,
        most_reach_px=16,
        kernel_share=0.5,
        sample_cost=1.0,
        extra=64**2,
    ),
    # Bundles of formats before 2.4 were made with it and keep its bits.
    "whole_kernel": WindowRule(
        margin_px=32,
        ring_px=16,
        most_reach_px=16,
        kernel_share=0.95,
        sample_cost=1.3,
        extra=0,
    ),
}
"""Name in the manifest -> rule."""


def explain_lights(
    block: Block,
    unknown: Mask,
    background: FloatArray,
    settings: Wiener,
    kernel_px: int | None,
) -> tuple[FloatArray, NDArray[np.float64]]:
    """Explain the light around the clipped samples of a block.

    Args:
        block: With clipped samples.
        unknown: Those and what the demosaic made of them, see `spread_clipped`.
        background: (c, 1, 1), read_variance / shot.
        settings: Rounds of Richardson-Lucy, and how far their result counts.
        kernel_px: Side of the kernel; None for one that fits no window.

    Returns:
        (c, b, b) float32 light, 0 away from clipped samples; (c,) mean over the block of the
        squared light near them that it does not explain.
    """
    assert block.unknown is not None
    samples, side = block.samples, block.samples.shape[-1]
    clipped = block.unknown
    rounds, reach_px = settings.clip_iterations, settings.clip_reach_px
    power = settings.clip_power
    rule = RULES[settings.clip_windows]
    windows = choose_windows(
        np.asarray(clipped.any(axis=0)), side, fitted_px(settings, kernel_px), rule
    )
    if windows is None or reach_px is None:
        near = nearness(clipped, reach_px)
        light = richardson_lucy(samples, block.otf, background, rounds, unknown, power=power)
        return light * near, _unexplained(block, light, unknown, near) / side**2
    size, cells = windows
    core, step = size - 2 * rule.margin_px, side // size
    otf: ComplexArray = np.ascontiguousarray(block.otf[:, ::step, ::step])
    lights = np.zeros_like(samples)
    weight = np.zeros(clipped.shape, dtype=np.float32)
    unexplained = np.zeros(len(samples))
    parts = []
    waiting = clipped.copy()
    for row, column in cells:
        cell_mask = np.zeros_like(clipped)
        cell = np.s_[:, row : row + core, column : column + core]
        cell_mask[cell] = waiting[cell]
        waiting[cell] = False
        top, first = (int(np.clip(i - rule.margin_px, 0, side - size)) for i in (row, column))
        place = np.s_[:, top : top + size, first : first + size]
        near = nearness(cell_mask[place], reach_px)
        cut = np.ascontiguousarray(unknown[place])
        window = Block(samples=taper_edges(samples[place], otf, rule.ring_px), otf=otf)
        light = richardson_lucy(window.samples, otf, background, rounds, cut, power=power)
        unexplained += _unexplained(window, light, cut, near)
        weight[place] += near
        parts.append((place, light * near))
    np.maximum(weight, 1, out=weight)
    for place, part in parts:
        lights[place] += part / weight[place]
    return lights, unexplained / side**2


def choose_windows(
    clipped: Mask, side_px: int, kernel_px: int | None, rule: WindowRule, *, step_px: int = 1
) -> tuple[int, Cells] | None:
    """Choose windows that cost less than the whole block.

    Args:
        clipped: (b, b) of a block, or of its squares of `step_px`.
        side_px: b.
        kernel_px: Side of the kernel; None for one that fits no window.
        rule: Of the bank.
        step_px: Side of the squares.

    Returns:
        Side of the windows and the first (row, column), in samples, of the cells, of side - 2
        margins, that cover the clipped samples; None where the whole block is the least work.
    """
    best, least = None, float(side_px * side_px)
    for shrink in () if kernel_px is None else SHRINKS:
        size = side_px // shrink
        core = size - 2 * rule.margin_px
        narrow = size < rule.kernel_share * (kernel_px or 0) or core < step_px
        if narrow or side_px % shrink or size % 4:
            continue
        cost = size * size * rule.sample_cost + rule.extra
        cells = _cover(clipped, core // step_px, most=int(least / cost))
        if cells is not None and len(cells) * cost < least:
            best = size, tuple((row * step_px, column * step_px) for row, column in cells)
            least = len(cells) * cost
    return best


def _cover(clipped: Mask, core: int, *, most: int) -> Cells | None:
    """Cover what is clipped with squares of `core`, each from its first row and column on.

    Returns:
        First (row, column) of each square; None where it takes more than `most`.
    """
    waiting = clipped.copy()
    cells: list[tuple[int, int]] = []
    while waiting.any():
        if len(cells) == most:
            return None
        row = int(waiting.any(axis=1).argmax())
        column = int(waiting[row : row + core].any(axis=0).argmax())
        waiting[row : row + core, column : column + core] = False
        cells.append((row, column))
    return tuple(cells)


def light_share(
    clipped: Mask, side_px: int, kernel_px: int | None, settings: Wiener, *, step_px: int
) -> float:
    """Return the work of explaining as a share of that in the whole block; see `choose_windows`."""
    rule = RULES[settings.clip_windows]
    windows = choose_windows(clipped, side_px, kernel_px, rule, step_px=step_px)
    if windows is None:
        return 1.0
    size, cells = windows
    return len(cells) * (size * size * rule.sample_cost + rule.extra) / side_px**2


def fitted_px(settings: Wiener, kernel_px: int | None) -> int | None:
    """Return the side of the kernel to choose windows by; None where whole blocks are explained."""
    reach_px = settings.clip_reach_px
    most_px = RULES[settings.clip_windows].most_reach_px
    whole = settings.whole_blocks or reach_px is None or reach_px > most_px
    return None if whole else kernel_px


def nearness(clipped: Mask, reach_px: int | None) -> FloatArray:
    """Return (c, h, w): 1 up to half the reach from clipped samples, falling smoothly to 0.

    Args:
        clipped: (c, h, w).
        reach_px: Where it is 0; None gives 1 everywhere.
    """
    if reach_px is None:
        return np.ones(clipped.shape, dtype=np.float32)
    near, fade = np.zeros(clipped.shape, dtype=np.float32), _fade(reach_px)
    for mask, plane in zip(clipped, near, strict=True):
        if mask.any():
            unclipped = (~mask).astype(np.uint8)
            distance = cv2.distanceTransform(unclipped, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            # OpenCV's last bits change from call to call; a squared distance is a whole number
            square = np.minimum(np.rint(np.square(distance)), reach_px**2)
            plane[:] = fade[square.astype(np.intp)]
    return near


@lru_cache(maxsize=4)
def _fade(reach_px: int) -> FloatArray:
    """Return the nearness by squared distance from the nearest clipped sample."""
    t = np.clip(2 - np.sqrt(np.arange(reach_px**2 + 1)) * 2 / reach_px, 0, 1)
    return np.asarray(t * t * (3 - 2 * t), dtype=np.float32)


def _unexplained(
    block: Block, light: FloatArray, unknown: Mask, near: FloatArray
) -> NDArray[np.float64]:
    """Return (c,): the sum of squares near the lights that are left unexplained."""
    residual = block.samples - apply_transfer(light, block.otf)
    np.copyto(residual, 0, where=unknown)
    np.square(residual, out=residual)
    residual *= near
    return np.asarray(residual.sum(axis=(-2, -1), dtype=np.float64))

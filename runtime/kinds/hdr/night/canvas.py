"""The canvas of a night scene: surfaces that are lit, and light that shines of itself."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.scenes.texture import Generator, cut_texture, make_texture

SLOPES: Final = (0.7, 1.0, 1.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Canvas:
    """A scene in the making; things are painted into its arrays, back to front.

    Attributes:
        surface: (3, h, w) float32 reflectance, 0..1.
        light: (3, h, w) float32 radiance that comes from the place itself, 1.0 = white.
        gloss: (h, w) float32, how much of what stands above it a place mirrors.
        textures: Periodic textures, from rough to soft, see `make_texture`.
    """

    surface: FloatArray
    light: FloatArray
    gloss: FloatArray
    textures: tuple[FloatArray, ...]

    @property
    def size(self) -> tuple[int, int]:
        """Return (height, width) in pixels."""
        return self.light.shape[1], self.light.shape[2]

    def count_lit(self) -> int:
        """Count the pixels that shine above white in any colour."""
        return int(np.count_nonzero((self.light > 1).any(axis=0)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A part of a canvas around a place.

    Attributes:
        rows: Of the canvas.
        columns: Of the canvas.
        dy: (a, 1) float32 offsets of its rows from the place, in pixels.
        dx: (1, b) float32 offsets of its columns.
    """

    rows: slice
    columns: slice
    dy: FloatArray
    dx: FloatArray

    @property
    def at(self) -> tuple[slice, slice, slice]:
        """Return the index of the patch in planes."""
        return slice(None), self.rows, self.columns


def new_canvas(rng: Generator, height: int, width: int) -> Canvas:
    """Return a black canvas with fresh textures."""
    return Canvas(
        surface=np.zeros((3, height, width), dtype=np.float32),
        light=np.zeros((3, height, width), dtype=np.float32),
        gloss=np.zeros((height, width), dtype=np.float32),
        textures=tuple(make_texture(rng, slope) for slope in SLOPES),
    )


def patch_around(
    canvas: Canvas, cy: float, cx: float, reach_y: float, reach_x: float | None = None
) -> Patch | None:
    """Return the part of a canvas within a reach of a place, in pixels; None if it lies outside."""
    height, width = canvas.size
    side_reach = reach_y if reach_x is None else reach_x
    top, bottom = max(0, int(cy - reach_y - 1)), min(height, int(cy + reach_y + 2))
    left, right = max(0, int(cx - side_reach - 1)), min(width, int(cx + side_reach + 2))
    if top >= bottom or left >= right:
        return None
    return Patch(
        rows=slice(top, bottom),
        columns=slice(left, right),
        dy=(np.arange(top, bottom, dtype=np.float32) - np.float32(cy))[:, None],
        dx=(np.arange(left, right, dtype=np.float32) - np.float32(cx))[None, :],
    )


def cover(canvas: Canvas, patch: Patch, alpha: FloatArray, paint: FloatArray) -> None:
    """Paint something opaque and dark over the canvas.

    Args:
        canvas: Painted in place.
        patch: Where.
        alpha: (a, b) coverage of the pixels, 0..1.
        paint: Reflectance, broadcast to (3, a, b).
    """
    surface, light = canvas.surface[patch.at], canvas.light[patch.at]
    surface += alpha * (paint - surface)
    light *= 1 - alpha
    canvas.gloss[patch.rows, patch.columns] *= 1 - alpha


def shine(canvas: Canvas, patch: Patch, alpha: FloatArray, radiance: FloatArray) -> None:
    """Paint something that shines over the canvas; arguments as those of `cover`."""
    light = canvas.light[patch.at]
    light += alpha * (radiance - light)


def glow(canvas: Canvas, patch: Patch, radiance: FloatArray) -> None:
    """Add light to what is there, broadcast to (3, a, b)."""
    canvas.light[patch.at] += radiance


def textured(
    rng: Generator, canvas: Canvas, patch: Patch, colour: FloatArray, depth: float, kind: int = 1
) -> FloatArray:
    """Return (3, a, b) of a colour with a texture of some depth, the mean of the logarithm kept."""
    rows, columns = patch.dy.shape[0], patch.dx.shape[1]
    cut = cut_texture(rng, canvas.textures[kind], rows, columns)
    return np.asarray(colour[:, None, None] * np.exp(np.float32(depth) * cut))


def disc(patch: Patch, radius: float) -> FloatArray:
    """Return the coverage of a disc, anti-aliased over one pixel; a point keeps its area."""
    alpha = np.clip(np.float32(radius + 0.5) - np.hypot(patch.dy, patch.dx), 0, 1)
    # below half a pixel the area of a disc is less than its anti-aliased one
    return np.asarray(alpha * np.float32(min(1.0, 2 * radius)))


def rectangle(patch: Patch, half_height: float, half_width: float) -> FloatArray:
    """Return the coverage of an upright rectangle, anti-aliased over one pixel."""
    down = np.clip(np.float32(half_height + 0.5) - np.abs(patch.dy), 0, 1)
    across = np.clip(np.float32(half_width + 0.5) - np.abs(patch.dx), 0, 1)
    return np.asarray(down * across)


def stroke_distance(patch: Patch, points: FloatArray) -> FloatArray:
    """Return the distance of every pixel from a line through points.

    Args:
        patch: Where.
        points: (n, 2) float32, (y, x) offsets from the place of the patch, n > 1.

    Returns:
        (a, b) float32 pixels.
    """
    nearest = np.full((patch.dy.shape[0], patch.dx.shape[1]), np.inf, dtype=np.float32)
    for (start_y, start_x), (end_y, end_x) in pairwise(points):
        down, across = end_y - start_y, end_x - start_x
        length2 = max(float(down**2 + across**2), 1e-6)
        y, x = patch.dy - start_y, patch.dx - start_x
        along = np.clip((y * down + x * across) / np.float32(length2), 0, 1)
        np.minimum(nearest, (y - along * down) ** 2 + (x - along * across) ** 2, out=nearest)
    return np.asarray(np.sqrt(nearest))

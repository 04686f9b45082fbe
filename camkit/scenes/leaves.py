"""Dead leaves: occluding textured discs, ellipses and rectangles whose sizes follow a power law.

References: Lee, Mumford and Huang 2001, "Occlusion models for natural images" (dead leaves with
size density r^-3).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.scenes.texture import Generator, cut_texture, draw_colour, draw_count

LEAF_LAYERS: Final = 2.5
LEAF_MIN_PX: Final = 4.0
LEAF_MAX_PX: Final = 160.0


def add_leaves(
    rng: Generator,
    scene: FloatArray,
    textures: Sequence[FloatArray],
    *,
    least_px: float = LEAF_MIN_PX,
) -> None:
    """Cover a scene with leaves, in place.

    Args:
        rng: Draws sizes, places and colours.
        scene: (3, h, w) float32, linear.
        textures: One for each shape of leaf, see `make_texture`.
        least_px: Radius of the smallest.
    """
    _, height, width = scene.shape
    radii = _leaf_radii(rng, height, width, least_px)
    centres = rng.random((radii.size, 2)) * (height, width)
    kinds = rng.integers(0, 3, radii.size)
    angles = rng.uniform(0, np.pi, radii.size)
    depths = np.abs(rng.normal(0, 0.25, radii.size)).astype(np.float32)
    # A leaf in three stays bare: the flat patches on which noise and ringing are seen.
    depths[rng.random(radii.size) < 1 / 3] = 0
    for radius, (cy, cx), kind, angle, depth in zip(
        radii, centres, kinds, angles, depths, strict=True
    ):
        box = box_around(scene, cy, cx, radius)
        if box is None:
            continue
        region, dy, dx = box
        alpha = _leaf_mask(int(kind), radius, angle, dy, dx)
        paint = draw_colour(rng)[:, None, None]
        if depth > 0:
            cut = cut_texture(rng, textures[int(kind)], region.shape[1], region.shape[2])
            paint = paint * np.exp(depth * cut)
        region += alpha * (paint - region)


def _leaf_radii(rng: Generator, height: int, width: int, least_px: float) -> NDArray[np.float64]:
    """Draw radii with density r^-3, enough to cover the picture LEAF_LAYERS times."""
    largest = max(least_px * 2, min(LEAF_MAX_PX, 0.35 * min(height, width)))
    log_span = np.log(largest / least_px)
    mean_area = 2 * np.pi * least_px**2 * log_span
    number = draw_count(rng, LEAF_LAYERS * height * width / mean_area)
    low, high = least_px**-2, largest**-2
    return np.asarray((low - rng.random(number) * (low - high)) ** -0.5)


def box_around(
    scene: FloatArray, cy: float, cx: float, radius: float
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the view of a scene around a centre and the offsets (dy, dx) of its pixels.

    Args:
        scene: (3, h, w).
        cy: Row of the centre, in pixels.
        cx: Its column.
        radius: What must lie inside, in pixels.

    Returns:
        (3, a, b) view, (a, 1) and (1, b) offsets; None where all of it lies outside.
    """
    _, height, width = scene.shape
    top, left = max(0, int(cy - radius - 1)), max(0, int(cx - radius - 1))
    bottom, right = min(height, int(cy + radius + 2)), min(width, int(cx + radius + 2))
    if top >= bottom or left >= right:
        return None
    dy = (np.arange(top, bottom, dtype=np.float32) - np.float32(cy))[:, None]
    dx = (np.arange(left, right, dtype=np.float32) - np.float32(cx))[None, :]
    return scene[:, top:bottom, left:right], dy, dx


def _leaf_mask(
    kind: int, radius: float, angle: float, dy: FloatArray, dx: FloatArray
) -> FloatArray:
    """Return the coverage (0..1, anti-aliased over one pixel) of a disc, ellipse or rectangle."""
    if kind == 0:
        return np.asarray(np.clip(np.float32(radius) - np.hypot(dy, dx) + 0.5, 0, 1))
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    u, v = c * dx + s * dy, c * dy - s * dx
    r = np.float32(radius)
    if kind == 1:
        return np.asarray(np.clip((r - np.hypot(u, 2 * v)) / 1.5 + 0.5, 0, 1))
    inside = np.minimum(0.8 * r - np.abs(u), 0.5 * r - np.abs(v))
    return np.clip(inside + 0.5, 0, 1)

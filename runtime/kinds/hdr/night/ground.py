"""The ground below the lamps: paving, and what wet paving or water mirrors of the lights."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import Canvas, Patch, cover, textured
from camkit.scenes.texture import Generator, cut_texture, sample_texture

COLUMN_BLOCK: Final = 512
WAVE_PX: Final = 9.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Mirror:
    """The reflection of the ground.

    Attributes:
        top: Row over which it mirrors.
        depth: Rows below it that do.
        smear: Rows that one point is drawn out to, as a share of its distance from `top`.
    """

    top: int
    depth: int
    smear: float


def add_ground(rng: Generator, canvas: Canvas, top: int, *, water: bool) -> None:
    """Draw the ground from a row down to the lower edge.

    Args:
        rng: Draws its colour and markings.
        canvas: Painted in place.
        top: Its first row.
        water: A river and not a street.
    """
    height, width = canvas.size
    if top >= height:
        return
    patch = Patch(
        rows=slice(top, height),
        columns=slice(0, width),
        dy=np.arange(height - top, dtype=np.float32)[:, None],
        dx=np.arange(width, dtype=np.float32)[None, :],
    )
    value = rng.uniform(0.01, 0.03) if water else rng.uniform(0.06, 0.22)
    colour = np.full(3, value, dtype=np.float32)
    paving = textured(rng, canvas, patch, colour, 0.25, kind=0)
    if not water and rng.random() < 0.6:
        paving += np.float32(0.4) * _crossing(rng, patch)
    cover(canvas, patch, np.ones((1, 1), dtype=np.float32), np.minimum(paving, 0.8))


def _crossing(rng: Generator, patch: Patch) -> FloatArray:
    """Return the stripes of a crossing that run towards a point above the ground."""
    depth = patch.dy + np.float32(12)
    at = (patch.dx - np.float32(rng.random() * patch.dx.shape[1])) / depth
    stripe = np.clip((np.abs((at * rng.uniform(1, 2)) % 1 - 0.5) - 0.25) * depth / 4 + 0.5, 0, 1)
    rows = patch.dy.shape[0]
    first, last = np.sort(rng.uniform(0.1, 0.9, 2)) * rows
    return np.asarray(stripe * ((patch.dy > first) & (patch.dy < last)), dtype=np.float32)


def wet_ground(rng: Generator, canvas: Canvas, top: int, *, water: bool) -> Mirror | None:
    """Mirror the part above a row in the ground; things that are drawn later hide it.

    Args:
        rng: Draws how wet and how rough it is.
        canvas: Painted in place.
        top: First row of the ground, over which it mirrors.
        water: With waves that break the lines, not paving with puddles.

    Returns:
        What `add_reflection` needs; None where there is no ground or nothing above it.
    """
    height, width = canvas.size
    depth = min(height - top, top)
    if depth < 2:
        return None
    share = np.float32(rng.uniform(0.2, 0.5) if water else rng.uniform(0.02, 0.25))
    canvas.gloss[top : top + depth] = share * _roughness(rng, canvas, depth, width, water=water)
    return Mirror(top=top, depth=depth, smear=float(rng.uniform(0.15, 0.5)))


def add_reflection(scene: FloatArray, gloss: FloatArray, mirror: Mirror) -> None:
    """Add what the ground mirrors: vertical smears that grow downwards.

    A slope of the surface by an angle moves what it mirrors twice as far along the plane of
    incidence, and hardly at all across it where the view is grazing: lights become vertical lines.

    Args:
        scene: (3, h, w), changed in place.
        gloss: (h, w), as that of a canvas.
        mirror: Of `wet_ground`.
    """
    top, depth, width = mirror.top, mirror.depth, scene.shape[2]
    rows = np.arange(depth)
    # the mean over rows `near` to `far` of the mirrored picture, more of them the further down
    near = np.clip((rows * (1 - mirror.smear) - 2).astype(np.intp), 0, depth - 1)
    far = np.clip((rows * (1 + mirror.smear) + 3).astype(np.intp), near + 1, depth)
    for left in range(0, width, COLUMN_BLOCK):
        columns = slice(left, min(left + COLUMN_BLOCK, width))
        mirrored = scene[:, top - depth : top, columns][:, ::-1]
        sums = np.zeros((3, depth + 1, mirrored.shape[2]))
        np.cumsum(mirrored, axis=1, out=sums[:, 1:])
        mean = (sums[:, far] - sums[:, near]) / (far - near)[:, None]
        scene[:, top : top + depth, columns] += mean * gloss[top : top + depth, columns]


def _roughness(
    rng: Generator, canvas: Canvas, height: int, width: int, *, water: bool
) -> FloatArray:
    """Return (h, w) factors of mean about 1: waves, or puddles and grain."""
    if not water:
        puddles = np.exp(0.7 * cut_texture(rng, canvas.textures[2], height, width))
        grain = np.exp(0.3 * cut_texture(rng, canvas.textures[0], height, width))
        return np.asarray(puddles * grain / 1.35, dtype=np.float32)
    # waves are wide and low, and lower far away than near
    rows = np.cumsum(4 / (1 + np.arange(height) / max(height / 4, 1)))
    places = rows + rng.integers(512), np.arange(width) / WAVE_PX + rng.integers(512)
    waves = sample_texture(canvas.textures[0], *places)
    return np.asarray(np.clip(0.6 + 0.8 * waves, 0, 3), dtype=np.float32)

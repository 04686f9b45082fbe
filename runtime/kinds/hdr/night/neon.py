"""Advertisements: bent tubes of light, and lit panels with glyphs."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    Patch,
    cover,
    glow,
    patch_around,
    rectangle,
    shine,
    stroke_distance,
)
from camkit.runtime.kinds.hdr.night.lamp import draw_neon, draw_power, draw_white
from camkit.scenes.lettering import set_text
from camkit.scenes.texture import Generator

GLOW_REACH: Final = 12.0
CURVES: Final = ("arc", "wave", "spiral", "arrow", "script")


def add_neon(rng: Generator, canvas: Canvas, cy: float, cx: float, size: float) -> None:
    """Draw a bent tube, once or twice side by side in two colours, with its glow.

    Args:
        rng: Draws curve, colour and thickness.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        size: Half of its longer side, in pixels.
    """
    points = _curve(rng) * np.float32(size)
    power, thick = draw_power(rng, 3.0, 160.0), rng.uniform(0.7, 2.2)
    for twin in range(int(rng.integers(1, 3))):
        radiance = draw_neon(rng) * power
        reach = 1.25 * size + GLOW_REACH * thick + 4
        patch = patch_around(canvas, cy, cx, reach)
        if patch is None:
            return
        distance = stroke_distance(patch, points * np.float32(1 + 0.25 * twin))
        _shine_tube(canvas, patch, distance, radiance, thick)


def _shine_tube(
    canvas: Canvas, patch: Patch, distance: FloatArray, radiance: FloatArray, thick: float
) -> None:
    """Paint a tube by the distance from its axis: round, and hot in the middle."""
    column = radiance[:, None, None]
    glow_light = np.exp(-distance / np.float32(2.5 * thick + 1))
    glow_light *= np.maximum(1 - distance / np.float32(GLOW_REACH * thick + 4), 0)
    glow(canvas, patch, column * np.float32(0.02) * glow_light)
    alpha = np.clip(np.float32(thick + 0.5) - distance, 0, 1)
    core = 1 - 0.45 * np.minimum(distance / np.float32(thick), 1) ** 2
    shine(canvas, patch, alpha, column * core)


def _curve(rng: Generator) -> FloatArray:
    """Return (n, 2) points (y, x) of a curve within -1..1."""
    kind = CURVES[int(rng.integers(len(CURVES)))]
    t = np.linspace(0, 1, 22)
    if kind == "arc":
        angle = rng.uniform(0, 2 * np.pi) + t * rng.uniform(0.6, 1) * 2 * np.pi
        return _points(rng.uniform(0.4, 1) * np.sin(angle), np.cos(angle))
    if kind == "wave":
        return _points(0.3 * np.sin(t * 2 * np.pi * rng.uniform(1, 3)), 2 * t - 1)
    if kind == "spiral":
        angle = t * rng.uniform(2, 3.5) * np.pi
        return _points(t * np.sin(angle), t * np.cos(angle))
    if kind == "arrow":
        return _points(np.array([0.0, 0.0, -0.4, 0.0, 0.4]), np.array([-1.0, 0.9, 0.4, 0.9, 0.4]))
    # a line of joined letters: loops along a base line
    turns = rng.integers(3, 6) * 2 * np.pi
    t = np.linspace(0, 1, 44)
    tall = 0.18 + 0.12 * np.sin(7 * t + rng.uniform(0, 6))
    return _points(tall * np.cos(turns * t), 1.8 * t - 0.9 - 0.14 * np.sin(turns * t))


def _points(y: np.ndarray, x: np.ndarray) -> FloatArray:
    return np.stack([y, x], axis=1).astype(np.float32)


def add_sign(
    rng: Generator, canvas: Canvas, cy: float, cx: float, half: tuple[float, float]
) -> None:
    """Draw a lit panel: letters of light on a dark ground, or dark ones on a bright ground.

    Args:
        rng: Draws colours and letters.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        half: Half its height and half its width, in pixels.
    """
    patch = patch_around(canvas, cy, cx, half[0] + 1, half[1] + 1)
    if patch is None:
        return
    panel = rectangle(patch, *half)
    cover(canvas, patch, panel, np.full((3, 1, 1), 0.05, dtype=np.float32))
    ink = set_text(rng, patch.dy.shape[0], patch.dx.shape[1])
    colour = draw_neon(rng) if rng.random() < 0.6 else draw_white(rng)
    if rng.random() < 0.5:
        radiance = (colour * draw_power(rng, 2.0, 100.0))[:, None, None] * ink
        shine(canvas, patch, panel * (ink > 0), radiance)
        return
    ground = (colour * draw_power(rng, 0.8, 12.0))[:, None, None]
    # tubes behind the panel show as bands
    bands = 0.85 + 0.15 * np.cos(2 * np.pi * patch.dy / np.float32(half[0] * 0.66))
    shine(canvas, patch, panel, ground * bands * (1 - np.float32(0.93) * ink))

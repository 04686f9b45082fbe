"""Lamps: their colours, how bright and how large they are, and what one looks like."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    Patch,
    cover,
    disc,
    glow,
    patch_around,
    rectangle,
    shine,
)
from camkit.scenes.texture import Colour, Generator

LEAST_POWER: Final = 1.5
MOST_POWER: Final = 256.0
LEAST_RADIUS_PX: Final = 0.7
MOST_RADIUS_PX: Final = 48.0
WHITES: Final = {
    "sodium": (1.0, 0.42, 0.07),
    "tungsten": (1.0, 0.57, 0.24),
    "warm LED": (1.0, 0.74, 0.44),
    "white LED": (1.0, 0.94, 0.86),
    "cool LED": (0.80, 0.92, 1.0),
    "mercury": (0.68, 1.0, 0.84),
}
"""Linear Rec.709 of what lights streets and rooms, the strongest colour 1; shares by eye."""
COLOURS: Final = {
    "red": (1.0, 0.10, 0.05),
    "amber": (1.0, 0.38, 0.02),
    "green": (0.08, 1.0, 0.25),
    "cyan": (0.06, 0.75, 1.0),
    "blue": (0.10, 0.20, 1.0),
    "violet": (0.50, 0.12, 1.0),
    "pink": (1.0, 0.14, 0.55),
}
"""The same of neon, signals and advertisements."""
CLOTH: Final = (0.5, 0.4, 0.3)
"""Reflectance of a lampshade."""
_WHITES: Final = np.array(list(WHITES.values()), dtype=np.float32)
_COLOURS: Final = np.array(list(COLOURS.values()), dtype=np.float32)


def draw_white(rng: Generator) -> Colour:
    """Draw the (3,) colour of a lamp that lights something, its strongest component 1."""
    return _near(rng, _WHITES)


def draw_neon(rng: Generator) -> Colour:
    """Draw the (3,) colour of a lamp that is to be seen, its strongest component 1."""
    return _near(rng, _COLOURS)


def _near(rng: Generator, palette: FloatArray) -> Colour:
    base = palette[int(rng.integers(len(palette)))]
    colour = base * np.exp(rng.normal(0, 0.08, 3)).astype(np.float32)
    return np.asarray(colour / colour.max(), dtype=np.float32)


def draw_power(rng: Generator, least: float = LEAST_POWER, most: float = MOST_POWER) -> np.float32:
    """Draw how bright a lamp is against white; its logarithm is uniform."""
    return np.float32(np.exp(rng.uniform(np.log(least), np.log(most))))


def draw_radius(
    rng: Generator, most: float = MOST_RADIUS_PX, least: float = LEAST_RADIUS_PX
) -> float:
    """Draw a radius in pixels, of density r^-2: each span of radii covers the same area."""
    largest = max(most, least * 1.01)
    return float(1 / (1 / least - rng.random() * (1 / least - 1 / largest)))


def add_glow(
    canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray, strength: float
) -> None:
    """Add what haze and glass scatter around a lamp: it falls with the cube of the distance.

    Args:
        canvas: Painted in place.
        cy: Row of the lamp.
        cx: Its column.
        radius: Of the lamp, in pixels.
        radiance: (3,) of the lamp.
        strength: Of the glow at the lamp, as a share of its radiance.
    """
    reach = min(max(14 * radius, 10.0), 160.0)
    patch = patch_around(canvas, cy, cx, reach)
    if patch is None:
        return
    square_distance = (patch.dy**2 + patch.dx**2) / np.float32(reach**2)
    fall = (1 + square_distance * np.float32((reach / (1.5 * radius + 1)) ** 2)) ** np.float32(-1.5)
    fall *= np.maximum(1 - square_distance, 0) ** 2
    glow(canvas, patch, (radiance * np.float32(strength))[:, None, None] * fall)


def add_lamp(
    rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray
) -> None:
    """Draw a lamp: a globe, a tube, a field of diodes or a flame.

    Args:
        rng: Draws its form.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        radius: In pixels.
        radiance: (3,) where it is brightest.
    """
    add_glow(canvas, cy, cx, radius, radiance, rng.uniform(0.0005, 0.006))
    draw = rng.random()
    if radius < 2 or draw < 0.6:
        add_globe(rng, canvas, cy, cx, radius, radiance)
    elif draw < 0.75:
        _add_tube(rng, canvas, cy, cx, radius, radiance)
    elif draw < 0.88:
        _add_diodes(rng, canvas, cy, cx, radius, radiance)
    else:
        _add_flame(rng, canvas, cy, cx, radius, radiance)


def add_globe(
    rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray
) -> None:
    """Draw a round lamp that dims towards its rim and to one side; arguments as of `add_lamp`."""
    patch = patch_around(canvas, cy, cx, radius + 1)
    if patch is None:
        return
    angle, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.2)
    side = (patch.dy * np.sin(angle) + patch.dx * np.cos(angle)) * np.float32(tilt / radius)
    limb = np.float32(rng.uniform(0.05, 0.6))
    profile = 1 - limb * _squared(patch, radius) + side.astype(np.float32)
    _shine_profile(canvas, patch, disc(patch, radius), radiance, profile)


def _squared(patch: Patch, radius: float) -> FloatArray:
    square_distance = (patch.dy**2 + patch.dx**2) / np.float32(radius**2)
    return np.asarray(np.minimum(square_distance, 1), dtype=np.float32)


def _shine_profile(
    canvas: Canvas, patch: Patch, alpha: FloatArray, radiance: FloatArray, profile: FloatArray
) -> None:
    shape = np.clip(profile, 0.05, 1)
    shine(canvas, patch, alpha, radiance[:, None, None] * shape)


def _add_tube(
    rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray
) -> None:
    thick, long = radius * 0.45, radius * rng.uniform(1.2, 2.6)
    upright = rng.random() < 0.3
    reach = (long, thick) if upright else (thick, long)
    patch = patch_around(canvas, cy, cx, reach[0] + 1, reach[1] + 1)
    if patch is None:
        return
    along, across = (patch.dy, patch.dx) if upright else (patch.dx, patch.dy)
    ends = 1 - 0.5 * np.clip(np.abs(along) / np.float32(long), 0, 1) ** 6
    round_ = 1 - 0.4 * np.clip(np.abs(across) / np.float32(thick), 0, 1) ** 2
    _shine_profile(canvas, patch, rectangle(patch, *reach), radiance, np.asarray(ends * round_))


def _add_diodes(
    rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray
) -> None:
    """Draw a plate of points of light behind a dim cover."""
    half = radius * rng.uniform(0.5, 1.0), radius
    patch = patch_around(canvas, cy, cx, half[0] + 1, half[1] + 1)
    if patch is None:
        return
    step = np.float32(max(3.0, radius / rng.integers(1, 5)))
    points = np.cos(np.pi * patch.dy / step) ** 2 * np.cos(np.pi * patch.dx / step) ** 2
    _shine_profile(canvas, patch, rectangle(patch, *half), radiance, 0.12 + 0.88 * points**2)


def _add_flame(
    rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray
) -> None:
    """Draw a flame: narrow above, brightest below its middle, darker around the wick."""
    tall = radius * rng.uniform(1.6, 2.4)
    patch = patch_around(canvas, cy, cx, tall + 1, radius + 1)
    if patch is None:
        return
    height = np.clip((np.float32(tall) - patch.dy) / np.float32(2 * tall), 0, 1)
    lean = np.float32(rng.uniform(-0.3, 0.3) * radius) * height**2
    half = np.float32(radius * 1.9) * np.sqrt(height) * (1 - height)
    alpha = np.clip(half - np.abs(patch.dx - lean) + 0.5, 0, 1) * (half > 0.2)
    profile = 0.35 + 0.65 * np.exp(-(((height - 0.4) / 0.3) ** 2)) + 0 * patch.dx
    _shine_profile(canvas, patch, alpha, radiance, profile)


def add_shaded_lamp(
    rng: Generator, canvas: Canvas, cy: float, cx: float, size: float, radiance: FloatArray
) -> None:
    """Draw a lamp with a shade that glows, and its bulb below the rim.

    Args:
        rng: Draws form and side.
        canvas: Painted in place.
        cy: Row of the lower rim of the shade.
        cx: Column of its middle.
        size: Half the width of the rim, in pixels.
        radiance: (3,) of the bulb.
    """
    tall = size * rng.uniform(0.9, 1.5)
    patch = patch_around(canvas, cy - tall / 2, cx, tall / 2 + 1, size + 1)
    if patch is None:
        return
    depth = np.clip((patch.dy + np.float32(tall / 2)) / np.float32(tall), 0, 1)
    half = np.float32(size) * (np.float32(rng.uniform(0.3, 0.8)) * (1 - depth) + depth)
    inside = np.clip(np.float32(tall / 2) - np.abs(patch.dy) + 0.5, 0, 1)
    alpha = np.clip(half - np.abs(patch.dx) + 0.5, 0, 1) * inside
    cover(canvas, patch, alpha, np.array(CLOTH, dtype=np.float32)[:, None, None])
    cloth = np.exp(-((patch.dx / np.float32(size)) ** 2)) * (0.3 + 0.7 * depth)
    dim = np.minimum(radiance * np.float32(rng.uniform(0.02, 0.2)), 12)
    shine(canvas, patch, alpha, dim[:, None, None] * cloth)
    add_glow(canvas, cy, cx, size / 3, radiance, 0.01)
    add_globe(rng, canvas, cy + size * 0.1, cx, max(size * 0.22, 0.8), radiance)

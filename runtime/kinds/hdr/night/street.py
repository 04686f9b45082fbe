"""Things in a street: rows of lamps, cars, garlands, wires, railings, wheels."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    cover,
    disc,
    glow,
    patch_around,
    rectangle,
    shine,
    stroke_distance,
)
from camkit.runtime.kinds.hdr.night.lamp import (
    add_globe,
    add_glow,
    add_lamp,
    draw_neon,
    draw_power,
    draw_white,
)
from camkit.scenes.texture import Generator

TAIL_RED: Final = (1.0, 0.04, 0.02)


def add_lamp_row(rng: Generator, canvas: Canvas, cy: float, cx: float, size: float) -> None:
    """Draw a row of equal street lamps that runs to a vanishing point, with their posts.

    Args:
        rng: Draws side, number and light.
        canvas: Painted in place.
        cy: Row of the vanishing point.
        cx: Its column.
        size: Height of the nearest lamp over it, in pixels.
    """
    side = rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0)
    radiance = draw_white(rng) * draw_power(rng, 4.0)
    bulb, base = size * rng.uniform(0.015, 0.05), rng.uniform(0.2, 0.6)
    for step in range(int(rng.integers(4, 12)), 0, -1):
        near = 1 / (1 + 0.55 * (step - 1))
        y, x = cy - size * near, cx + side * size * near
        post = patch_around(canvas, y + size * near * (1 + base) / 2, x, size * near, 3)
        if post is not None:
            alpha = rectangle(post, size * near * (1 + base) / 2, max(0.5, 2 * near))
            cover(canvas, post, alpha, np.full((3, 1, 1), 0.08, dtype=np.float32))
        radius = max(bulb * near, 0.6)
        add_glow(canvas, y, x, radius, radiance, 0.01)
        add_globe(rng, canvas, y, x, radius, radiance)


def add_car(rng: Generator, canvas: Canvas, cy: float, cx: float, size: float) -> None:
    """Draw a car with headlights or tail lights, the cone of its glare and its light on the road.

    Args:
        rng: Draws which way it drives and its colour.
        canvas: Painted in place.
        cy: Row of its lamps.
        cx: Column between them.
        size: Half of their distance, in pixels.
    """
    is_oncoming = rng.random() < 0.65
    body = patch_around(canvas, cy - size * 0.3, cx, size * 1.2, size * 1.5)
    if body is None:
        return
    paint = np.full((3, 1, 1), rng.uniform(0.02, 0.3), dtype=np.float32)
    cover(canvas, body, rectangle(body, size * 0.9, size * 1.3), paint)
    glass = patch_around(canvas, cy - size * 0.75, cx, size * 0.3, size)
    if glass is not None:
        cover(canvas, glass, rectangle(glass, size * 0.28, size * 0.95), paint * np.float32(0.2))
    colour = draw_white(rng) if is_oncoming else np.array(TAIL_RED, dtype=np.float32)
    radiance = colour * (draw_power(rng, 20.0) if is_oncoming else draw_power(rng, 1.5, 25.0))
    radius = max(0.8, size * rng.uniform(0.1, 0.2))
    for x in (cx - size, cx + size):
        if is_oncoming:
            _add_cone(canvas, cy, x, radius, radiance)
        add_glow(canvas, cy, x, radius, radiance, 0.015)
        add_globe(rng, canvas, cy, x, radius, radiance)


def _add_cone(canvas: Canvas, cy: float, cx: float, radius: float, radiance: FloatArray) -> None:
    """Add the light that a headlight throws on the road before it, and into the haze."""
    long = radius * 18
    patch = patch_around(canvas, cy + long / 2, cx, long / 2, long * 0.6)
    if patch is None:
        return
    depth = np.clip((patch.dy + np.float32(long / 2)) / np.float32(long), 0, 1)
    wide = np.float32(radius) + np.float32(0.45 * long) * depth
    fall = np.exp(-2 * (patch.dx / wide) ** 2) * depth * (1 - depth) ** 2
    glow(canvas, patch, np.minimum(radiance * np.float32(0.02), 2.5)[:, None, None] * fall)


def add_garland(rng: Generator, canvas: Canvas, cy: float, cx: float, half_width: float) -> None:
    """Draw a wire with bulbs between two places: a parabola, like a short catenary.

    Args:
        rng: Draws slack, distance and colours of the bulbs.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        half_width: In pixels.
    """
    slack, tilt = rng.uniform(0.05, 0.35) * half_width, rng.uniform(-0.3, 0.3) * half_width
    at = np.linspace(-1, 1, 17)
    wire = np.stack([slack * (1 - at**2) + tilt * at, half_width * at], 1).astype(np.float32)
    add_wire(canvas, cy, cx, wire, 0.5)
    radius, power = rng.uniform(0.6, 2.4), draw_power(rng, 2.0, 120.0)
    bulbs = max(3, int(2 * half_width / (radius * rng.uniform(6, 18))))
    colour, mixed = draw_white(rng), rng.random() < 0.4
    for where in np.linspace(-1, 1, bulbs):
        radiance = (draw_neon(rng) if mixed else colour) * power
        y = cy + slack * (1 - where**2) + tilt * where + radius
        add_glow(canvas, y, cx + half_width * where, radius, radiance, 0.006)
        add_globe(rng, canvas, y, cx + half_width * where, radius, radiance)


def add_wire(canvas: Canvas, cy: float, cx: float, points: FloatArray, thick: float) -> None:
    """Draw a dark line through points (n, 2), (y, x) offsets from a place."""
    reach_y, reach_x = (float(np.abs(points[:, axis]).max()) + 2 for axis in (0, 1))
    patch = patch_around(canvas, cy, cx, reach_y, reach_x)
    if patch is None:
        return
    alpha = np.clip(np.float32(thick + 0.5) - stroke_distance(patch, points), 0, 1)
    alpha *= np.float32(min(1.0, 2 * thick))
    cover(canvas, patch, alpha, np.full((3, 1, 1), 0.04, dtype=np.float32))


def add_long_wire(rng: Generator, canvas: Canvas, cy: float) -> None:
    """Draw a straight wire across the picture."""
    _, width = canvas.size
    fall = rng.uniform(-0.25, 0.25) * min(width, 600) / 2
    for start in range(0, width, 600):
        half = min(600, width - start) / 2
        middle = cy + fall * (start + half - width / 2) / max(width / 2, 1)
        tilt = fall * half / max(width / 2, 1)
        ends = np.array([[-tilt, -half], [tilt, half]], dtype=np.float32)
        add_wire(canvas, middle, start + half, ends, 0.7)


def add_railing(rng: Generator, canvas: Canvas, top: float, bottom: float) -> None:
    """Draw upright bars between two rails across the picture: edges as straight as streaks."""
    height, width = canvas.size
    patch = patch_around(canvas, (top + bottom) / 2, width / 2, (bottom - top) / 2 + 2, width / 2)
    if patch is None or height < 8:
        return
    step, thick = np.float32(rng.uniform(9, 30)), np.float32(rng.uniform(0.6, 2.0))
    distance = np.abs((patch.dx + np.float32(rng.uniform(0, 30))) % step - step / 2)
    bars = np.clip(thick + 0.5 - distance, 0, 1) * np.ones_like(patch.dy)
    half = np.float32((bottom - top) / 2)
    rails = np.clip(1.4 * thick + 0.5 - np.abs(np.abs(patch.dy) - half), 0, 1)
    metal = np.full((3, 1, 1), rng.uniform(0.1, 0.6), dtype=np.float32)
    cover(canvas, patch, np.maximum(bars, rails), metal)


def add_wheel(rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float) -> None:
    """Draw a wheel of a fair: rings and spokes set with lamps."""
    spokes, bulb = int(rng.integers(8, 20)), max(0.6, radius * 0.012)
    power = draw_power(rng, 2.0, 100.0)
    colours = [draw_neon(rng) for _ in range(3)]
    angles = np.arange(spokes) * (2 * np.pi / spokes) + rng.uniform(0, 1)
    number = max(3, int(radius / (bulb * 9)))
    for part, angle in enumerate(angles):
        for share in np.linspace(0.12, 1, number):
            y, x = cy + radius * share * np.sin(angle), cx + radius * share * np.cos(angle)
            add_globe(rng, canvas, y, x, bulb, colours[part % 3] * power)
    ring = patch_around(canvas, cy, cx, radius + 2)
    if ring is not None:
        tint = colours[0] * np.float32(0.3 * power)
        distance = np.abs(np.hypot(ring.dy, ring.dx) - np.float32(radius))
        edge = np.asarray(np.clip(1.5 - distance, 0, 1), dtype=np.float32)
        shine(canvas, ring, edge, tint[:, None, None])


def add_moon(rng: Generator, canvas: Canvas, cy: float, cx: float) -> None:
    """Draw the moon, with its spots."""
    radius = rng.uniform(4, 16)
    patch = patch_around(canvas, cy, cx, radius + 1)
    if patch is None:
        return
    add_glow(canvas, cy, cx, radius, np.full(3, 2.0, dtype=np.float32), 0.02)
    spots = np.exp(0.12 * canvas.textures[2][: patch.dy.shape[0], : patch.dx.shape[1]])
    power = np.array([1.0, 0.97, 0.9], dtype=np.float32) * draw_power(rng, 1.5, 40.0)
    shine(canvas, patch, disc(patch, radius), power[:, None, None] * spots)


def add_trail(rng: Generator, canvas: Canvas, cy: float, cx: float, size: float) -> None:
    """Add the line that a moving lamp draws in a long exposure."""
    at = np.linspace(-1, 1, 13)
    bend, tilt = rng.uniform(-0.2, 0.2), rng.uniform(-0.3, 0.3)
    points = (np.stack([bend * at**2 + tilt * at, at], 1) * size).astype(np.float32)
    patch = patch_around(canvas, cy, cx, 0.6 * size + 4, size + 4)
    if patch is None:
        return
    thick = rng.uniform(0.6, 1.8)
    alpha = np.clip(np.float32(thick + 0.5) - stroke_distance(patch, points), 0, 1)
    red = np.array(TAIL_RED, dtype=np.float32)
    colour = red if rng.random() < 0.5 else draw_white(rng)
    shine(canvas, patch, alpha, (colour * draw_power(rng, 1.5, 30.0))[:, None, None])


def add_signal(rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float) -> None:
    """Draw a traffic light: a black box with three discs, one of which is lit."""
    box = patch_around(canvas, cy, cx, 5 * radius, 2 * radius)
    if box is None:
        return
    dark = np.full((3, 1, 1), 0.03, dtype=np.float32)
    cover(canvas, box, rectangle(box, 4.2 * radius, 1.5 * radius), dark)
    which = int(rng.integers(3))
    colour = ((1.0, 0.05, 0.03), (1.0, 0.5, 0.02), (0.05, 1.0, 0.5))[which]
    radiance = np.array(colour, dtype=np.float32) * draw_power(rng, 4.0, 120.0)
    add_lamp(rng, canvas, cy + 2.7 * radius * (which - 1), cx, radius, radiance)

"""A town at night: sky, rows of buildings, what hangs on them, lamps until enough is lit."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    Patch,
    cover,
    disc,
    glow,
    patch_around,
    rectangle,
    textured,
)
from camkit.runtime.kinds.hdr.night.facade import Building, add_building, add_near_window
from camkit.runtime.kinds.hdr.night.lamp import (
    MOST_RADIUS_PX,
    add_lamp,
    draw_neon,
    draw_power,
    draw_radius,
    draw_white,
)
from camkit.runtime.kinds.hdr.night.neon import add_neon, add_sign
from camkit.scenes.texture import Generator, draw_count

FILLING_ROUNDS: Final = 4
LEAST_LAMP_SHARE: Final = 0.5
"""Of the light of a scene that must be lamps, however much windows and signs give."""
AREA_PER_SIGN_PX: Final = 90_000
PLACE_TRIES: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Rows of a canvas in which things are put.

    Attributes:
        top: First row.
        bottom: Row below the last.
    """

    top: float
    bottom: float

    def draw(self, rng: Generator) -> float:
        """Draw a row."""
        return float(rng.uniform(self.top, self.bottom))


def add_sky(rng: Generator, canvas: Canvas, horizon: float) -> None:
    """Paint the sky of a town: dark above, brighter and warmer towards the horizon, clouds."""
    height, width = canvas.size
    rows = np.arange(height, dtype=np.float32)[:, None]
    patch = Patch(
        rows=slice(0, height),
        columns=slice(0, width),
        dy=rows,
        dx=np.arange(width, dtype=np.float32)[None, :],
    )
    high = np.array([0.6, 0.8, 1.3], np.float32) * draw_power(rng, 0.001, 0.015)
    low = draw_white(rng) * draw_power(rng, 0.004, 0.06)
    near = np.clip(rows / np.float32(max(horizon, 1)), 0, 1) ** 2
    clouds = textured(rng, canvas, patch, np.ones(3, np.float32), rng.uniform(0.1, 0.5), kind=2)
    sky = high[:, None, None] * (1 - near) + low[:, None, None] * near
    glow(canvas, patch, sky * clouds)


def add_buildings(rng: Generator, canvas: Canvas, rows: Span, lit: float) -> None:
    """Draw rows of buildings from the horizon down to the ground, the nearest last.

    Args:
        rng: Draws their sizes.
        canvas: Painted in place.
        rows: From the horizon to the ground.
        lit: Share of windows that are lit, about.
    """
    _, width = canvas.size
    tier_height = rng.uniform(90, 170)
    tiers = max(1, round((rows.bottom - rows.top) / tier_height))
    for tier in range(tiers):
        base = rows.bottom - (tiers - 1 - tier) * tier_height
        edge = -rng.uniform(0, 100)
        while edge < width:
            wide = rng.uniform(40, 230)
            tall = rng.uniform(50, 330) if tier == 0 else rng.uniform(0.5, 1.4) * tier_height
            share = float(np.clip(lit * np.exp(rng.normal(0, 0.7)), 0, 0.7))
            bottom = min(base + tier_height, rows.bottom)
            building = Building(
                top=base - tall, bottom=bottom, left=edge, right=edge + wide, lit=share
            )
            add_building(rng, canvas, building)
            edge += wide + (rng.uniform(0, 60) if tier == 0 and rng.random() < 0.3 else 0)


def add_signs(rng: Generator, canvas: Canvas, rows: Span, share: float) -> None:
    """Draw signs, tubes and near windows on the fronts, the more the more is lit."""
    height, width = canvas.size
    area = height * width
    mean = min(area / AREA_PER_SIGN_PX, share * area / 2500)
    for _ in range(draw_count(rng, mean)):
        half = rng.uniform(6, 26), rng.uniform(14, 80)
        half = half if rng.random() < 0.75 else (half[1], half[0])
        add_sign(rng, canvas, rows.draw(rng), rng.random() * width, half)
    for _ in range(draw_count(rng, mean)):
        add_neon(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(14, 75))
    for _ in range(draw_count(rng, min(area / 400_000, share * area / 15_000))):
        half = rng.uniform(12, 60), rng.uniform(10, 50)
        add_near_window(rng, canvas, rows.draw(rng), rng.random() * width, half)


def add_lamps(
    rng: Generator, canvas: Canvas, rows: Span, share: float, *, coloured: float = 0.15
) -> None:
    """Draw lamps until a share of the pixels shines above white.

    Args:
        rng: Draws places, sizes and colours.
        canvas: Painted in place.
        rows: Where they hang.
        share: Of the pixels of the canvas.
        coloured: Share of lamps that are coloured.
    """
    height, width = canvas.size
    goal = share * height * width
    missing_px = max(goal - canvas.count_lit(), LEAST_LAMP_SHARE * goal)
    for _ in range(FILLING_ROUNDS):
        most = float(np.clip(np.sqrt(0.3 * missing_px / np.pi), 0.8, MOST_RADIUS_PX))
        added_px = 0.0
        while added_px < missing_px:
            radius = draw_radius(rng, most)
            y, x = _place(rng, canvas, rows)
            colour = draw_neon(rng) if rng.random() < coloured else draw_white(rng)
            add_lamp(rng, canvas, y, x, radius, colour * draw_power(rng))
            added_px += 4 + np.pi * radius**2
        missing_px = goal - canvas.count_lit()
        if missing_px < 0.1 * goal:
            return


def _place(rng: Generator, canvas: Canvas, rows: Span) -> tuple[float, float]:
    """Draw where a lamp hangs: low rather than high, and on something rather than in the air."""
    height, width = canvas.size
    for _ in range(PLACE_TRIES):
        y = rows.bottom - (rows.bottom - rows.top) * rng.random() ** 1.5
        x = rng.random() * width
        if canvas.surface[:, int(np.clip(y, 0, height - 1)), int(x)].any():
            break
    return y, x


def add_tree(rng: Generator, canvas: Canvas, cy: float, cx: float, size: float) -> None:
    """Draw a tree: a cloud of leaves on a stem.

    Args:
        rng: Draws its leaves.
        canvas: Painted in place.
        cy: Row of the middle of its crown.
        cx: Its column.
        size: Half of its crown, in pixels.
    """
    green = np.array([0.05, 0.06, 0.03], dtype=np.float32) * np.float32(rng.uniform(0.5, 2))
    number = int(min(60 + 5 * size, 420))
    # three boughs, each a cloud of leaves
    boughs = rng.normal(0, 0.35 * size, (3, 2))
    places = boughs[rng.integers(0, 3, number)] + rng.normal(0, 0.28 * size, (number, 2))
    for (dy, dx), radius in zip(places, rng.uniform(1, 0.05 * size + 1.5, number), strict=True):
        patch = patch_around(canvas, cy + dy, cx + dx, radius + 1)
        if patch is not None:
            leaf = green * np.float32(np.exp(rng.normal(0, 0.5)))
            cover(canvas, patch, disc(patch, radius), leaf[:, None, None])
    stem = patch_around(canvas, cy + size, cx, 0.8 * size, 0.1 * size + 1)
    if stem is not None:
        wood = rectangle(stem, 0.8 * size, 0.035 * size + 0.5)
        cover(canvas, stem, wood, np.full((3, 1, 1), 0.06, dtype=np.float32))


def add_figure(rng: Generator, canvas: Canvas, cy: float, cx: float) -> None:
    """Draw a figure that stands dark before the light: a head and shoulders.

    Args:
        rng: Draws the size and the clothes.
        canvas: Painted in place.
        cy: Row of the middle of the head.
        cx: Its column.
    """
    head = rng.uniform(4, 11)
    dark = np.full((3, 1, 1), rng.uniform(0.02, 0.15), dtype=np.float32)
    body = patch_around(canvas, cy + 5.5 * head, cx, 4 * head, 2.2 * head)
    if body is not None:
        bent = body.dy * np.float32(0.55)
        alpha = np.clip(np.float32(2.2 * head + 0.5) - np.hypot(bent, body.dx), 0, 1)
        cover(canvas, body, alpha, dark)
    top = patch_around(canvas, cy, cx, head + 1)
    if top is not None:
        cover(canvas, top, disc(top, head), dark * np.float32(0.7))

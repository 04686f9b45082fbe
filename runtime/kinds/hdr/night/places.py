"""The places of night scenes: each is painted from back to front."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from camkit.runtime.kinds.hdr.night.bokeh import add_blur, add_bokeh
from camkit.runtime.kinds.hdr.night.canvas import Canvas
from camkit.runtime.kinds.hdr.night.facade import add_near_window
from camkit.runtime.kinds.hdr.night.ground import Mirror, add_ground, wet_ground
from camkit.runtime.kinds.hdr.night.lamp import add_shaded_lamp, draw_power, draw_white
from camkit.runtime.kinds.hdr.night.neon import add_neon
from camkit.runtime.kinds.hdr.night.street import (
    add_car,
    add_garland,
    add_lamp_row,
    add_long_wire,
    add_moon,
    add_railing,
    add_signal,
    add_trail,
    add_wheel,
)
from camkit.runtime.kinds.hdr.night.town import (
    Span,
    add_buildings,
    add_figure,
    add_lamps,
    add_signs,
    add_sky,
    add_tree,
)
from camkit.scenes.leaves import add_leaves
from camkit.scenes.texture import Generator, draw_count

AREA_PER_ROW_PX: Final = 250_000
AREA_PER_CAR_PX: Final = 60_000
AREA_PER_TREE_PX: Final = 160_000
AREA_PER_GARLAND_PX: Final = 130_000
LEAST_THING_PX: Final = 8.0
MOST_BOKEH_SHARE: Final = 0.7


def paint_street(rng: Generator, canvas: Canvas, share: float) -> Mirror | None:
    """Draw a street: fronts, signs, rows of lamps, wet or dry paving, cars, wires."""
    height, width = canvas.size
    horizon, ground = rng.uniform(0.1, 0.4) * height, rng.uniform(0.62, 0.9) * height
    rows = Span(top=horizon, bottom=ground)
    _paint_town(rng, canvas, rows, share)
    floor = int(ground)
    add_ground(rng, canvas, floor, water=False)
    for _ in range(_number(rng, canvas, AREA_PER_ROW_PX)):
        size = rng.uniform(90, 330)
        cy = rng.uniform(horizon + 0.4 * size, max(ground, horizon + 0.5 * size))
        add_lamp_row(rng, canvas, cy, rng.random() * width, size)
    for _ in range(_number(rng, canvas, AREA_PER_TREE_PX)):
        size = rng.uniform(20, 90)
        add_tree(rng, canvas, ground - rng.uniform(0.8, 2) * size, rng.random() * width, size)
    add_lamps(rng, canvas, rows, share)
    mirror = wet_ground(rng, canvas, floor, water=False) if rng.random() < 0.7 else None
    _add_traffic(rng, canvas, Span(top=ground, bottom=height))
    for _ in range(draw_count(rng, 1.2)):
        add_long_wire(rng, canvas, rng.uniform(0, ground))
    if rng.random() < 0.25:
        add_railing(rng, canvas, height - rng.uniform(30, 90), height - rng.uniform(2, 12))
    return mirror


def paint_waterfront(rng: Generator, canvas: Canvas, share: float) -> Mirror | None:
    """Draw a town across a river that mirrors its lights."""
    height, width = canvas.size
    horizon, ground = rng.uniform(0.15, 0.35) * height, rng.uniform(0.45, 0.65) * height
    rows = Span(top=horizon, bottom=ground)
    _paint_town(rng, canvas, rows, share * 0.6)
    floor = int(ground)
    add_ground(rng, canvas, floor, water=True)
    shore = Span(top=max(horizon, ground - 0.3 * (ground - horizon)), bottom=ground)
    add_lamps(rng, canvas, shore, share * 0.7)
    mirror = wet_ground(rng, canvas, floor, water=True)
    if rng.random() < 0.35:
        add_railing(rng, canvas, height - rng.uniform(40, 110), height - rng.uniform(2, 12))
    for _ in range(draw_count(rng, 0.5)):
        add_long_wire(rng, canvas, rng.uniform(0, ground))
    for _ in range(draw_count(rng, width / 2000)):
        add_tree(rng, canvas, height - rng.uniform(0, 80), rng.random() * width, 70.0)
    return mirror


def paint_room(rng: Generator, canvas: Canvas, share: float) -> Mirror | None:
    """Draw a room or a stall full of things, lit by lamps, candles and a window."""
    height, width = canvas.size
    area = height * width
    add_leaves(rng, canvas.surface, canvas.textures, least_px=LEAST_THING_PX)
    # things of a room are less coloured than leaves are
    grey = canvas.surface.mean(axis=0)
    canvas.surface[:] = grey + np.float32(0.45) * (canvas.surface - grey)
    rows = Span(top=0.1 * height, bottom=0.9 * height)
    for _ in range(draw_count(rng, min(area / 200_000, share * area / 9000))):
        half = rng.uniform(16, 70), rng.uniform(12, 60)
        add_near_window(rng, canvas, rows.draw(rng), rng.random() * width, half)
    for _ in range(_number(rng, canvas, 100_000)):
        radiance = draw_white(rng) * draw_power(rng, 6.0)
        size = rng.uniform(8, 8 + 300 * share**0.5)
        add_shaded_lamp(rng, canvas, rows.draw(rng), rng.random() * width, size, radiance)
    for _ in range(_number(rng, canvas, AREA_PER_GARLAND_PX * 2)):
        add_garland(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(50, 260))
    add_lamps(rng, canvas, rows, share, coloured=0.2)
    return None


def paint_bokeh(rng: Generator, canvas: Canvas, share: float) -> Mirror | None:
    """Draw a street out of focus behind things that are sharp."""
    height, width = canvas.size
    add_sky(rng, canvas, height * rng.uniform(0.5, 1.5))
    add_blur(rng, canvas)
    radius = rng.uniform(8, 38)
    missing = MOST_BOKEH_SHARE * share * height * width
    while missing > 0:
        # lamps stand in rows, so their discs do
        cy = height * (0.5 + 0.18 * rng.standard_normal())
        size = radius * rng.uniform(0.75, 1.25)
        power = add_bokeh(rng, canvas, cy, rng.random() * width, size)
        missing -= np.pi * size**2 * max(power > 1, 0.1)
    rows = Span(top=0.3 * height, bottom=height)
    for _ in range(_number(rng, canvas, AREA_PER_TREE_PX)):
        add_tree(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(30, 110))
    if rng.random() < 0.5:
        add_railing(rng, canvas, rng.uniform(0.5, 0.8) * height, rng.uniform(0.85, 1) * height)
    for _ in range(_number(rng, canvas, AREA_PER_GARLAND_PX)):
        add_garland(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(60, 300))
    add_lamps(rng, canvas, rows, share)
    return None


def paint_fair(rng: Generator, canvas: Canvas, share: float) -> Mirror | None:
    """Draw a fair: wheels, garlands, tubes, a crowd that stands dark before them."""
    height, width = canvas.size
    area = height * width
    add_sky(rng, canvas, 0.8 * height)
    rows = Span(top=0.15 * height, bottom=0.85 * height)
    for _ in range(draw_count(rng, min(area / 300_000, 0.5 + share * area / 4000))):
        add_wheel(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(50, 170))
    add_signs(rng, canvas, rows, share)
    for _ in range(1 + _number(rng, canvas, AREA_PER_GARLAND_PX)):
        add_garland(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(60, 300))
    for _ in range(draw_count(rng, min(area / 150_000, share * area / 3000))):
        add_neon(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(20, 90))
    ground = rng.uniform(0.75, 0.92) * height
    add_ground(rng, canvas, int(ground), water=False)
    add_lamps(rng, canvas, rows, share, coloured=0.6)
    mirror = wet_ground(rng, canvas, int(ground), water=False)
    for _ in range(draw_count(rng, width / 25)):
        add_figure(rng, canvas, height - rng.uniform(0, 60), rng.random() * width)
    return mirror


def _number(rng: Generator, canvas: Canvas, area_px: float) -> int:
    """Draw how many things there are, of which there is one on an area."""
    height, width = canvas.size
    return draw_count(rng, height * width / area_px)


def _paint_town(rng: Generator, canvas: Canvas, rows: Span, share: float) -> None:
    _, width = canvas.size
    add_sky(rng, canvas, rows.bottom)
    if rng.random() < 0.2:
        add_moon(rng, canvas, rng.uniform(0, rows.top), rng.random() * width)
    add_buildings(rng, canvas, rows, lit=0.03 + 3 * share)
    add_signs(rng, canvas, rows, share)


def _add_traffic(rng: Generator, canvas: Canvas, rows: Span) -> None:
    """Draw cars, the farthest first, signals, and sometimes the trails of cars that are gone."""
    height, width = canvas.size
    cars = rng.uniform(rows.top, rows.bottom, _number(rng, canvas, AREA_PER_CAR_PX))
    for cy in np.sort(cars):
        size = rng.uniform(5, 12) + 0.12 * min(cy - rows.top, 250)
        add_car(rng, canvas, float(cy), rng.random() * width, size)
    for _ in range(draw_count(rng, height * width / 300_000)):
        y = rows.top - rng.uniform(10, 60)
        add_signal(rng, canvas, y, rng.random() * width, rng.uniform(1.5, 7))
    if rng.random() < 0.2:
        for _ in range(1 + draw_count(rng, height * width / 80_000)):
            add_trail(rng, canvas, rows.draw(rng), rng.random() * width, rng.uniform(80, 300))


PLACES: Final[Mapping[Callable[[Generator, Canvas, float], Mirror | None], float]] = {
    paint_street: 0.38,
    paint_waterfront: 0.15,
    paint_room: 0.19,
    paint_bokeh: 0.15,
    paint_fair: 0.13,
}
"""How to paint a place, and how often it is drawn."""

"""What is put on a canvas: seen where it is put, nowhere else, and never beyond its power."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.bokeh import add_blur, add_bokeh
from camkit.runtime.kinds.hdr.night.canvas import Canvas, new_canvas
from camkit.runtime.kinds.hdr.night.facade import Building, add_building, add_near_window
from camkit.runtime.kinds.hdr.night.lamp import (
    COLOURS,
    LEAST_RADIUS_PX,
    MOST_POWER,
    WHITES,
    add_globe,
    add_lamp,
    add_shaded_lamp,
    draw_neon,
    draw_power,
    draw_radius,
    draw_white,
)
from camkit.runtime.kinds.hdr.night.neon import add_neon, add_sign
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
from camkit.runtime.kinds.hdr.night.town import Span, add_figure, add_lamps, add_tree
from camkit.scenes.texture import Generator

HEIGHT, WIDTH = 200, 260
POWER: FloatArray = np.array([40.0, 30.0, 20.0], dtype=np.float32)
Put = Callable[[Generator, Canvas, float, float], object]


def _with(put: Callable[..., object], *arguments: object) -> Put:
    return lambda rng, canvas, y, x: put(rng, canvas, y, x, *arguments)


def _house(rng: Generator, canvas: Canvas, y: float, x: float) -> None:
    add_building(
        rng, canvas, Building(top=y - 60, bottom=y + 60, left=x - 50, right=x + 50, lit=0.5)
    )


LIGHTS: dict[str, Put] = {
    "globe": _with(add_globe, 6.0, POWER),
    "lamp": _with(add_lamp, 9.0, POWER),
    "shaded lamp": _with(add_shaded_lamp, 20.0, POWER),
    "bokeh": _with(add_bokeh, 15.0),
    "neon": _with(add_neon, 40.0),
    "sign": _with(add_sign, (20.0, 50.0)),
    "near window": _with(add_near_window, (40.0, 30.0)),
    "house": _house,
    "row of lamps": _with(add_lamp_row, 60.0),
    "car": _with(add_car, 20.0),
    "garland": _with(add_garland, 60.0),
    "wheel": _with(add_wheel, 60.0),
    "moon": add_moon,
    "trail": _with(add_trail, 60.0),
    "signal": _with(add_signal, 8.0),
}
SURFACES: dict[str, Put] = {"tree": _with(add_tree, 40.0), "figure": add_figure, "house": _house}


@pytest.fixture(scope="module")
def textures() -> tuple[FloatArray, ...]:
    return new_canvas(np.random.default_rng(0), 1, 1).textures


def empty(textures: tuple[FloatArray, ...]) -> Canvas:
    planes = np.zeros((3, HEIGHT, WIDTH), dtype=np.float32)
    return Canvas(surface=planes, light=planes.copy(), gloss=planes[0].copy(), textures=textures)


@pytest.mark.parametrize("name", LIGHTS)
def test_lights_shine_where_they_are_put_whatever_their_form(name: str, textures) -> None:
    for seed in range(12):
        canvas = empty(textures)
        LIGHTS[name](np.random.default_rng(seed), canvas, 100, 130)
        assert canvas.light.max() > 0.05
        assert canvas.light.max() <= 1.05 * MOST_POWER
        assert canvas.light.min() >= 0
        assert np.isfinite(canvas.light).all()
        assert canvas.surface.min() >= 0
        assert canvas.surface.max() <= 1


@pytest.mark.parametrize("name", SURFACES)
def test_what_is_solid_covers_the_light_behind_it(name: str, textures) -> None:
    canvas = empty(textures)
    canvas.light[:] = 100
    SURFACES[name](np.random.default_rng(1), canvas, 80, 130)
    assert (canvas.light[0] < 30).sum() > 100


@pytest.mark.parametrize("name", [*LIGHTS, *SURFACES])
def test_beyond_the_canvas_nothing_is_painted(name: str, textures) -> None:
    canvas = empty(textures)
    for y, x in ((-900, 130), (100, 1200)):
        for seed in range(8):
            (LIGHTS | SURFACES)[name](np.random.default_rng(seed), canvas, y, x)
    assert not canvas.light.any()
    assert not canvas.surface.any()


@pytest.mark.parametrize(
    "put",
    [
        partial(add_long_wire, cy=90.0),
        partial(add_railing, top=60.0, bottom=110.0),
    ],
)
def test_wires_and_railings_cross_the_whole_picture(put, textures) -> None:
    canvas = empty(textures)
    canvas.light[:] = 10
    put(np.random.default_rng(0), canvas)
    assert (canvas.light[0].min(axis=0) < 8).all()


@pytest.mark.parametrize(
    "put",
    [partial(add_long_wire, cy=900.0), partial(add_railing, top=-60.0, bottom=-20.0)],
)
def test_wires_and_railings_outside_leave_the_picture_as_it_is(put, textures) -> None:
    canvas = empty(textures)
    canvas.light[:] = 10
    put(np.random.default_rng(0), canvas)
    assert (canvas.light == 10).all()


def test_powers_and_radii_are_drawn_evenly_over_what_they_span() -> None:
    rng = np.random.default_rng(0)
    powers = np.log2([draw_power(rng) for _ in range(4000)])
    assert (np.log2(1.5) <= powers).all()
    assert (powers <= 8).all()
    parts, _ = np.histogram(powers, 6)
    assert parts.min() > 0.85 * parts.mean()
    radii = np.array([draw_radius(rng, 40.0) for _ in range(40000)])
    assert radii.min() >= LEAST_RADIUS_PX
    assert radii.max() <= 40
    area, _ = np.histogram(radii, np.linspace(1, 40, 6), weights=radii**2)
    assert area.min() > 0.7 * area.mean()


def test_colours_are_those_of_lamps_and_of_full_strength() -> None:
    rng = np.random.default_rng(0)
    for draw, palette in ((draw_white, WHITES), (draw_neon, COLOURS)):
        for _ in range(50):
            colour = draw(rng)
            assert colour.max() == 1
            nearest = min(np.abs(np.log(colour / np.array(c))).max() for c in palette.values())
            assert nearest < 0.7


def test_a_window_ends_at_its_frame(textures) -> None:
    canvas = empty(textures)
    add_near_window(np.random.default_rng(3), canvas, 100, 130, (30.0, 20.0))
    rows, columns = np.nonzero(canvas.light.max(axis=0) > 0.5)
    assert rows.min() >= 69
    assert rows.max() <= 131
    assert columns.min() >= 109
    assert columns.max() <= 151


def test_a_disc_out_of_focus_is_cut_towards_the_corners(textures) -> None:
    areas = []
    for y, x in ((100, 130), (30, 30)):
        canvas = empty(textures)
        add_bokeh(np.random.default_rng(1), canvas, y, x, 20.0)
        areas.append(np.count_nonzero(canvas.light[1]))
    assert areas[1] < 0.9 * areas[0]


def test_what_is_blurred_has_no_edges(textures) -> None:
    canvas = empty(textures)
    add_blur(np.random.default_rng(0), canvas)
    spread = np.ptp(canvas.surface[1])
    assert spread > 0.003
    assert np.abs(np.diff(canvas.surface[1], axis=1)).max() < 0.15 * spread


@pytest.mark.parametrize("share", [0.003, 0.03])
def test_lamps_are_hung_until_the_share_is_lit(share: float, textures) -> None:
    canvas = empty(textures)
    canvas.surface[:, 100:] = 0.3
    add_lamps(np.random.default_rng(2), canvas, Span(top=0, bottom=HEIGHT), share)
    assert 0.7 * share < canvas.count_lit() / (HEIGHT * WIDTH) < 2.5 * share
    low = (canvas.light[:, 100:] > 1).any(axis=0).sum()
    assert low > 0.75 * canvas.count_lit()

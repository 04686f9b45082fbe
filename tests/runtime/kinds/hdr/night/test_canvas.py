"""Things cover what is behind them, lights replace or add, and every edge is one pixel soft."""

from itertools import pairwise

import numpy as np
import pytest

from camkit.runtime.kinds.hdr.night.canvas import (
    Canvas,
    cover,
    disc,
    glow,
    new_canvas,
    patch_around,
    rectangle,
    shine,
    stroke_distance,
)


@pytest.fixture
def canvas() -> Canvas:
    return new_canvas(np.random.default_rng(0), 60, 80)


def test_what_covers_a_lamp_puts_it_out(canvas: Canvas) -> None:
    patch = patch_around(canvas, 30, 40, 10)
    assert patch is not None
    shine(canvas, patch, disc(patch, 8), np.full((3, 1, 1), 5, np.float32))
    glow(canvas, patch, np.full((3, 1, 1), 0.5, np.float32))
    assert canvas.light[0, 30, 40] == 5.5
    assert canvas.count_lit() == pytest.approx(np.pi * 64, rel=0.15)
    cover(canvas, patch, rectangle(patch, 20, 20), np.full((3, 1, 1), 0.3, np.float32))
    assert canvas.count_lit() == 0
    assert canvas.surface[1, 30, 40] == np.float32(0.3)


@pytest.mark.parametrize("radius", [0.2, 0.5, 1.0, 3.3, 9.0])
def test_a_disc_has_its_area_wherever_it_lies_between_the_pixels(
    canvas: Canvas, radius: float
) -> None:
    areas = []
    for shift in np.random.default_rng(1).random((40, 2)):
        patch = patch_around(canvas, 30 + shift[0], 40 + shift[1], radius + 1)
        assert patch is not None
        areas.append(disc(patch, radius).sum())
    assert np.mean(areas) == pytest.approx(np.pi * radius**2, rel=0.35 if radius < 1 else 0.12)


def test_a_patch_ends_at_the_canvas_and_is_none_beyond_it(canvas: Canvas) -> None:
    patch = patch_around(canvas, 2, 78.5, 5, 3)
    assert patch is not None
    assert (patch.rows, patch.columns) == (slice(0, 9), slice(74, 80))
    assert (patch.dy[2, 0], patch.dx[0, 0]) == (0, -4.5)
    assert patch_around(canvas, -20, 40, 5) is None
    assert patch_around(canvas, 30, 100, 5) is None


def test_the_distance_from_a_bent_line_is_that_of_its_nearest_point(canvas: Canvas) -> None:
    patch = patch_around(canvas, 30, 40, 20)
    assert patch is not None
    points = np.array([[-10, -10], [-10, 10], [8, 10], [8, 10]], dtype=np.float32)
    along = np.linspace(0, 1, 400)[:, None]
    dense = np.concatenate([a + along * (b - a) for a, b in pairwise(points)])
    away = np.hypot(patch.dy[..., None] - dense[:, 0], patch.dx[..., None] - dense[:, 1]).min(
        axis=-1
    )
    np.testing.assert_allclose(stroke_distance(patch, points), away, atol=0.03)

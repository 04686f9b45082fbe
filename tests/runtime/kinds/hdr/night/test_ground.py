"""Wet ground mirrors what stands above it, as vertical smears, until something stands before it."""

import numpy as np
import pytest

from camkit.runtime.kinds.hdr.night.canvas import cover, new_canvas, patch_around, rectangle
from camkit.runtime.kinds.hdr.night.ground import Mirror, add_reflection, wet_ground


def test_a_lamp_becomes_a_vertical_line_at_its_mirrored_place_with_its_energy() -> None:
    scene = np.zeros((3, 200, 60), dtype=np.float32)
    scene[:, 60, 30] = 100
    gloss = np.zeros((200, 60), dtype=np.float32)
    gloss[100:] = 0.5
    add_reflection(scene, gloss, Mirror(top=100, depth=100, smear=0.2))
    below = scene[0, 100:]
    assert not below[:, :30].any()
    assert not below[:, 31:].any()
    rows = np.flatnonzero(below[:, 30])
    assert rows[0] + 100 < 140 < rows[-1] + 100
    assert np.ptp(rows) > 10
    # a mean over rows keeps the light but for the growth of the smear along it
    assert below.sum() == pytest.approx(50, rel=0.15)


def test_means_are_those_of_a_slow_loop() -> None:
    rng = np.random.default_rng(3)
    scene, gloss = rng.random((3, 50, 7)).astype(np.float32), np.full((50, 7), 0.3, np.float32)
    expected = scene.copy()
    for row in range(20):
        first = min(max(int(row * 0.7 - 2), 0), 19)
        last = min(max(int(row * 1.3 + 3), first + 1), 20)
        mirrored = [scene[:, 29 - r] for r in range(first, last)]
        expected[:, 30 + row] += 0.3 * np.mean(mirrored, axis=0)
    add_reflection(scene, gloss, Mirror(top=30, depth=20, smear=0.3))
    np.testing.assert_allclose(scene, expected, rtol=1e-5)


@pytest.mark.parametrize("water", [True, False])
def test_what_stands_on_the_ground_hides_what_it_mirrors(water: bool) -> None:
    rng = np.random.default_rng(0)
    canvas = new_canvas(rng, 120, 80)
    mirror = wet_ground(rng, canvas, 60, water=water)
    assert mirror is not None
    assert (mirror.top, mirror.depth) == (60, 60)
    assert not canvas.gloss[:60].any()
    assert 0.005 < canvas.gloss[60:].mean() < 0.6
    patch = patch_around(canvas, 90, 40, 10)
    assert patch is not None
    cover(canvas, patch, rectangle(patch, 8, 8), np.zeros((3, 1, 1), np.float32))
    assert not canvas.gloss[84:96, 34:46].any()


@pytest.mark.parametrize("top", [0, 1, 119, 120])
def test_no_ground_or_nothing_above_it_mirrors_nothing(top: int) -> None:
    rng = np.random.default_rng(0)
    assert wet_ground(rng, new_canvas(rng, 120, 20), top, water=True) is None

"""Edges, stars and discs whose truth is known."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from camkit.scenes.clean import (
    BRIGHTEST,
    LAMP_RADIUS_PX,
    MOST_LAMPS,
    SKY,
    Disc,
    disc_on_black,
    edges,
    night,
    star_field,
    with_lamps,
)


@pytest.mark.parametrize("seed", range(6))
def test_edges_are_flat_but_for_one_pixel(seed: int) -> None:
    scene = edges(np.random.default_rng(seed), 96)
    assert scene.shape == (3, 96, 96)
    assert scene.dtype == np.float32
    assert 0 < scene.min() < scene.max() < 2 * BRIGHTEST
    steps = np.abs(np.diff(scene[1], axis=1))
    # an edge crosses a row within two steps, or runs along a few
    assert (steps > 0.02 * steps.max()).mean() < 0.2
    assert steps.max() > 0.1 * scene[1].min()


def test_stars_are_small_and_the_sky_is_dark() -> None:
    skies = [night(np.random.default_rng(seed), 128) for seed in range(12)]
    for scene in skies:
        assert scene.min() > 0.2 * SKY[0]
        assert scene.max() > 0.02
    with_disc = [float((scene[1] > 0.03).mean()) for scene in skies]
    assert min(with_disc) < 0.02 < max(with_disc)


def test_training_sees_the_night_it_always_saw() -> None:
    """Recorded before stars and discs became functions of their own."""
    rng = np.random.default_rng(3)
    found = [night(rng, 64) for _ in range(4)]
    np.testing.assert_allclose(
        [s.mean() for s in found], (0.0556057, 0.1152502, 0.0014183, 0.0005284), rtol=1e-4
    )
    assert rng.random() == pytest.approx(0.7439102073505471)


def test_lone_stars_keep_their_distance() -> None:
    rng = np.random.default_rng(0)
    field = star_field(rng, (120, 200), light=0.5, sky=1e-3, pitch_px=40)
    assert field.shape == (3, 120, 200)
    peaks = np.argwhere(field[1] == maximum_filter(field[1], 15))
    peaks = peaks[field[1][tuple(peaks.T)] > 0.05]
    assert len(peaks) == 15
    apart = np.hypot(*(peaks[:, None] - peaks[None]).transpose(2, 0, 1))
    assert apart[apart > 0].min() >= 28


def test_a_disc_covers_its_area() -> None:
    disc = Disc(center_px=(50.3, 61.7), radius_px=20.4)
    scene = disc_on_black(np.random.default_rng(0), (100, 120), disc, light=0.5, sky=1e-3)
    inside, sky = scene[0, 50, 62], scene[0, 0, 0]
    assert ((scene[0] - sky) / (inside - sky)).sum() == pytest.approx(np.pi * 20.4**2, rel=1e-3)


def test_lamps_are_small_and_beyond_white_and_leave_the_rest() -> None:
    scene = np.full((3, 64, 64), 0.1, np.float32)
    for seed in range(20):
        lit = with_lamps(np.random.default_rng(seed), scene)
        changed = (lit != scene).any(axis=0)
        assert 0 < changed.sum() < MOST_LAMPS * np.pi * (LAMP_RADIUS_PX[1] + 1) ** 2
        assert lit.max() > 0.3
    assert (scene == np.float32(0.1)).all()

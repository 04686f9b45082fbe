"""Edges, stars and discs whose truth is known."""

import numpy as np
import pytest

from camkit.models_def.training.clean_scenes import BRIGHTEST, SKY, edges, night
from camkit.models_def.training.pictures import open_source


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


def test_a_source_draws_them_as_often_as_it_is_told() -> None:
    def drawn(**shares: float) -> list[np.ndarray]:
        source = open_source(None, picture_share=0, scenes=2, scene_px=96, **shares)
        rng = np.random.default_rng(0)
        return [source.draw_crop(rng, 48) for _ in range(60)]

    flat = [np.median(np.abs(np.diff(crop[1]))) < 1e-6 for crop in drawn(edge_share=0.5)]
    assert 15 < sum(flat) < 45
    assert not any(np.median(np.abs(np.diff(crop[1]))) < 1e-6 for crop in drawn())
    dark = [np.median(crop) < 0.01 for crop in drawn(night_share=1.0)]
    assert np.mean(dark) > 0.5

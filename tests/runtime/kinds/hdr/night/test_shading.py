"""What lamps light: as much as inverse square and cosine law say, and never more than white."""

import numpy as np

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.night.canvas import Canvas
from camkit.runtime.kinds.hdr.night.shading import CELL_PX, _cells, _irradiance, shade


def canvas_of(light: FloatArray, reflectance: float = 0.5) -> Canvas:
    return Canvas(
        surface=np.full_like(light, reflectance),
        light=light.copy(),
        gloss=np.zeros(light.shape[1:], dtype=np.float32),
        textures=(),
    )


def test_irradiance_is_a_sum_over_all_lamps_as_written_down() -> None:
    rng = np.random.default_rng(0)
    cells = rng.random((3, 9, 14), dtype=np.float32)
    found = _irradiance(cells, 2.5)
    for y, x in ((0, 0), (4, 7), (8, 13)):
        slow = np.zeros(3)
        for row in range(9):
            for column in range(14):
                far = ((row - y) ** 2 + (column - x) ** 2) / 2.5**2
                slow += cells[:, row, column] * (1 + far) ** -1.5
        np.testing.assert_allclose(found[:, y, x], slow, rtol=1e-5)


def test_cells_hold_means_of_what_they_cover_at_the_border_too() -> None:
    light = np.random.default_rng(1).random((3, 19, 21), dtype=np.float32)
    found = _cells(light)
    assert found.shape == (3, 3, 3)
    np.testing.assert_allclose(found[:, 0, 1], light[:, :8, 8:16].mean(axis=(1, 2)), rtol=1e-5)
    np.testing.assert_allclose(found[:, 2, 2], light[:, 16:, 16:].mean(axis=(1, 2)), rtol=1e-5)


def test_surfaces_are_bright_beside_a_lamp_and_dark_far_from_it() -> None:
    light = np.zeros((3, 80, 400), dtype=np.float32)
    light[:, 36:44, 36:44] = 200
    shown = shade(np.random.default_rng(0), canvas_of(light), 0.04)[1, 40, 60:]
    assert shown[0] > 3 * shown[-1]
    assert (np.diff(shown) <= 1e-6).all()


def test_nothing_that_is_lit_is_brighter_than_white_and_lamps_stay_what_they_are() -> None:
    light = np.zeros((3, 64, 64), dtype=np.float32)
    light[:, 20:30, 20:30] = 250
    shown = shade(np.random.default_rng(0), canvas_of(light, 0.9), 0.08)
    dark = light == 0
    assert shown[dark].max() < 1
    np.testing.assert_allclose(shown[~dark], 250, atol=1)


def test_the_median_of_surfaces_is_the_one_that_is_asked_for() -> None:
    light = np.zeros((3, 160, 160), dtype=np.float32)
    light[:, 20:24, 20:24] = 100
    rng = np.random.default_rng(2)
    for median in (0.02, 0.06):
        shown = shade(rng, canvas_of(light, 0.4), median).mean(axis=0)
        assert 0.85 * median < np.median(shown) < 1.1 * median


def test_without_a_lamp_or_a_surface_there_is_still_a_picture() -> None:
    dark = np.zeros((3, 2 * CELL_PX, CELL_PX + 1), dtype=np.float32)
    for reflectance in (0.0, 0.5):
        shown = shade(np.random.default_rng(0), canvas_of(dark, reflectance), 0.05)
        assert np.isfinite(shown).all()
        assert shown.max() < 0.2

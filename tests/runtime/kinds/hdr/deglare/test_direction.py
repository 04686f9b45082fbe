"""The angle of streaks: found well even in a small picture, the same under other noise, or not."""

import math

import numpy as np
import pytest

from camkit.runtime.kinds.hdr.deglare.direction import Direction, find_direction
from camkit.runtime.kinds.hdr.deglare.overview import overview_of
from tools.hdr.glare_twin import exposed_scene, photographed, two_point_star

LEAST, MOST = math.radians(2.5), math.radians(8)
SCENE = exposed_scene("night:6", 192, 256)


def _found(angle_deg: float | None, noise: int = 0) -> Direction | None:
    star = None if angle_deg is None else two_point_star(math.radians(angle_deg), "exponential")
    seen = photographed(SCENE, star, noise).picture
    overview = overview_of(lambda a, b: seen[:, a:b], *seen.shape[1:], 0.9)
    return find_direction(overview, LEAST, MOST)


@pytest.mark.parametrize("angle_deg", [-5.0, 3.0])
def test_the_angle_is_found_with_its_sign(angle_deg: float) -> None:
    found = _found(angle_deg)
    assert found is not None
    assert abs(math.degrees(found.angle_rad) - angle_deg) < 0.2
    assert found.agreement > 0.4


def test_other_noise_moves_the_angle_by_less_than_a_tenth_of_a_degree() -> None:
    found = [_found(-5.0, noise) for noise in range(3)]
    angles = [math.degrees(one.angle_rad) for one in found if one is not None]
    assert len(angles) == 3
    assert max(angles) - min(angles) < 0.1
    assert max(angles) > min(angles)  # not a grid of candidates


def test_nothing_is_found_where_there_are_no_streaks() -> None:
    assert _found(None) is None


def test_streaks_outside_the_range_are_not_found() -> None:
    assert _found(14.0) is None


def test_a_pole_through_every_light_is_no_streak() -> None:
    picture = np.full((3, 120, 160), 0.05, np.float32)
    for x in range(10, 160, 12):
        picture[:, :, x : x + 3] = 0.4
        picture[:, 55:60, x - 1 : x + 4] = 1
    overview = overview_of(lambda a, b: picture[:, a:b], 120, 160, 0.9)
    assert find_direction(overview, LEAST, MOST) is None


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2), (2, 2)])
def test_pictures_of_a_few_pixels_have_no_direction(shape: tuple[int, int]) -> None:
    picture = np.ones((3, *shape), np.float32)
    overview = overview_of(lambda a, b: picture[:, a:b], *shape, 0.9)
    assert find_direction(overview, LEAST, MOST) is None

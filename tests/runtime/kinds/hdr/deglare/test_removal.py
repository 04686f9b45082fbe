"""Streaks go, lights stay, and where nothing is sure nothing changes."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.deglare.removal import Glare, GlareSettings, find_glare
from tools.hdr.glare_twin import Shot, exposed_scene, photographed, psnr_db, two_point_star

SETTINGS = GlareSettings(
    least_rad=math.radians(2.5), most_rad=math.radians(8), reach=0.25, level=0.9
)
SHAPE = (192, 256)
SCENE = exposed_scene("night:6", *SHAPE)
Gains = tuple[float, float, float]


def _shot(seed: int = 0) -> Shot:
    return photographed(SCENE, two_point_star(math.radians(-5)), seed)


def _opened(picture: FloatArray) -> Callable[[], Callable[[int, int], FloatArray]]:
    return lambda: lambda top, bottom: picture[:, top:bottom]


def _found(picture: FloatArray) -> Glare:
    return find_glare(_opened(picture), *picture.shape[1:], SETTINGS)


def _cleared(glare: Glare, picture: FloatArray, gains: Gains = (1.0, 1.0, 1.0)) -> FloatArray:
    made = picture.copy()
    glare.paint(made, 0, gains)
    return made


@pytest.fixture(scope="module")
def shot() -> Shot:
    return _shot()


@pytest.fixture(scope="module")
def glare(shot: Shot) -> Glare:
    return _found(shot.picture)


def test_a_night_scene_gains_six_decibels(shot: Shot, glare: Glare) -> None:
    cleared = _cleared(glare, shot.picture)
    assert psnr_db(cleared, shot, 0.9) > psnr_db(shot.picture, shot, 0.9) + 6


def test_lights_are_untouched_and_nothing_becomes_brighter(shot: Shot, glare: Glare) -> None:
    cleared = _cleared(glare, shot.picture)
    light = (shot.picture >= 0.9).any(axis=0)
    assert light.sum() > 100
    np.testing.assert_array_equal(cleared[:, light], shot.picture[:, light])
    assert (cleared <= shot.picture).all()
    assert cleared.min() >= 0


def test_no_pixel_ends_below_its_smooth_surroundings(shot: Shot, glare: Glare) -> None:
    assert glare.slant is not None
    floor = glare.slant.resampled(glare.floor, 0, SHAPE[0])
    assert (_cleared(glare, shot.picture) >= np.minimum(shot.picture, floor)).all()
    assert floor.max() > 0


def test_rows_painted_in_bands_are_those_of_the_whole(shot: Shot, glare: Glare) -> None:
    whole = _cleared(glare, shot.picture)
    parts = shot.picture.copy()
    for top in range(0, SHAPE[0], 7):
        glare.paint(parts[:, top : top + 7], top, (1.0, 1.0, 1.0))
    np.testing.assert_array_equal(parts, whole)


def test_gains_multiply_the_streaks(shot: Shot, glare: Glare) -> None:
    gains = (2.0, 1.0, 0.5)
    gain = np.array(gains, np.float32)[:, None, None]
    np.testing.assert_array_equal(
        _cleared(glare, shot.picture * gain, gains), _cleared(glare, shot.picture) * gain
    )


def test_frames_with_other_noise_differ_by_little_more_than_their_noise(shot: Shot) -> None:
    other = _shot(seed=1)
    made = [_cleared(_found(one.picture), one.picture) for one in (shot, other)]
    dim = (shot.picture.max(axis=0) < 0.9) & (other.picture.max(axis=0) < 0.9)
    noise = float(np.std((shot.picture - other.picture)[:, dim]))
    assert float(np.std((made[0] - made[1])[:, dim])) < 1.3 * noise


def test_the_sidecar_says_what_was_found(glare: Glare) -> None:
    said = glare.to_json()
    assert said["angle_deg"] == pytest.approx(-5, abs=0.15)
    assert said["streak_peak"] is not None
    assert said["streak_peak"] > 0.05
    assert glare.notes == ()


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        (np.full((3, 40, 50), 0.2, np.float32), "no light reaches the white level"),
        (np.ones((3, 40, 50), np.float32), "100% of the picture is at the white level"),
        (np.minimum(exposed_scene("night:6", 120, 160), 1), "no streaks at 2.5 to 8 degrees"),
    ],
)
def test_an_unchanged_picture_says_why(picture: FloatArray, told: str) -> None:
    found = _found(picture)
    np.testing.assert_array_equal(_cleared(found, picture), picture)
    (note,) = found.notes
    assert note.startswith("no streaks were removed: ")
    assert told in note
    assert found.to_json()["angle_deg"] is None


def test_the_work_can_be_stopped(shot: Shot) -> None:
    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        find_glare(_opened(shot.picture), *SHAPE, SETTINGS, stop)

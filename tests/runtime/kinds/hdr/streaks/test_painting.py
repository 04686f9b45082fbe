"""A recovery laid over pixels: nearer to the scene, in any bands the same, nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS
from camkit.runtime.kinds.hdr.streaks.painting import DIMMEST, Painter, _untinted
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, recover
from camkit.scenes.saturation import CEILING
from tests.streak_factory import (
    blurred,
    captured_cells,
    one_light,
    star,
    star_kernels,
    street,
    with_lamps,
)

GAINS = (1.9, 1.0, 1.5)
ONES = (1.0, 1.0, 1.0)
LAMPS = [
    (50, 60, 4.0, (40.0, 30.0, 20.0)),
    (100, 140, 2.0, (200.0, 150.0, 90.0)),
    (40, 180, 1.5, (90.0, 90.0, 90.0)),
]
HEIGHT, WIDTH = 161, 209


def _db(found: FloatArray, truth: FloatArray, peak: float) -> float:
    gap = np.clip(found, 0, peak) - np.minimum(truth, peak)
    return float(10 * np.log10(peak**2 / np.mean(gap**2, dtype=np.float64)))


@pytest.fixture(scope="module")
def night() -> tuple[FloatArray, FloatArray]:
    scene = with_lamps(street(HEIGHT, WIDTH), LAMPS)
    return scene, blurred(scene, star())


@pytest.fixture(scope="module")
def found(night: tuple[FloatArray, FloatArray]) -> Recovery:
    return recover(captured_cells(night[1]), star_kernels())


def _painted(recovery: Recovery, planes: FloatArray, gains: tuple[float, ...]) -> FloatArray:
    """Paint a picture in one band."""
    out = planes * np.array(gains, np.float32)[:, None, None]
    Painter(recovery).paint(out, 0, gains)
    return out


# ------------------------------------------------------------------------ what it is for


@pytest.mark.parametrize(("cfa", "gain_db"), [("RGGB", 3.0), ("GRBG", 3.0), (None, 4.0)])
def test_lights_and_what_lies_beside_them_end_nearer_to_the_scene(
    night: tuple[FloatArray, FloatArray], cfa: CfaPattern | None, gain_db: float
) -> None:
    """Full planes are painted, so that no demosaic is judged."""
    scene, light = night
    seen = np.minimum(light, 1)
    got = _painted(recover(captured_cells(light, cfa), star_kernels(cfa)), seen, ONES)
    assert _db(got, scene, CEILING) > _db(seen, scene, CEILING) + gain_db
    beside = (light < 1).all(axis=0)
    assert _db(got[:, beside], scene[:, beside], 1) > _db(seen[:, beside], scene[:, beside], 1) + 3


def test_without_lights_the_veil_alone_goes() -> None:
    """What is left is the blur of the core, of 4 px."""
    scene = street(128, 160, 3) * 2
    scene[:, 30:60, 40:90] = 0.9
    kernels, middle = star(), star().shape[-1] // 2
    inner = np.s_[:, middle - 5 : middle + 6, middle - 5 : middle + 6]
    core = kernels[inner] / kernels[inner].sum((-2, -1), keepdims=True)
    wanted, seen = blurred(scene, core), blurred(scene, kernels)
    got = _painted(recover(captured_cells(seen), star_kernels()), seen, ONES)
    assert _db(seen, wanted, 1) < 42
    assert _db(got, wanted, 1) > 55


def test_an_even_grey_picture_stays_what_it_is() -> None:
    grey = np.full((3, 64, 80), 0.25, np.float32)
    got = _painted(recover(captured_cells(grey), star_kernels()), grey, GAINS)
    np.testing.assert_allclose(got / 0.25, np.array(GAINS)[:, None, None] + 0 * got, rtol=1e-3)


def test_too_much_clipped_puts_no_lights_in_but_takes_the_veil() -> None:
    scene = street(96, 128)
    scene[:, :, 80:] = 3
    seen = np.minimum(blurred(scene, star()), 1)
    got = _painted(recover(captured_cells(blurred(scene, star())), star_kernels()), seen, ONES)
    assert got.max() < 1.1
    assert got[:, 40, 40].max() < seen[:, 40, 40].min() + 0.1


# ------------------------------------------------------------------------ bands and gains


@pytest.mark.parametrize("band", [1, 7, 64, HEIGHT - 1])
def test_bands_of_any_height_have_the_same_bits(
    night: tuple[FloatArray, FloatArray], found: Recovery, band: int
) -> None:
    seen = np.minimum(night[1], 1)
    whole = _painted(found, seen, GAINS)
    painter = Painter(found)
    rows = seen * np.array(GAINS, np.float32)[:, None, None]
    for top in range(0, HEIGHT, band):
        painter.paint(rows[:, top : top + band], top, GAINS)
    np.testing.assert_array_equal(rows, whole)


def test_gains_multiply_what_is_painted(
    night: tuple[FloatArray, FloatArray], found: Recovery
) -> None:
    seen = np.minimum(night[1], 1)
    one, other = (_painted(found, seen, gains) for gains in (ONES, GAINS))
    np.testing.assert_allclose(other, one * np.array(GAINS)[:, None, None], rtol=1e-4, atol=1e-5)


# ------------------------------------------------------------------------ lights


def test_lights_are_put_where_samples_clipped_and_nowhere_else(
    night: tuple[FloatArray, FloatArray], found: Recovery
) -> None:
    seen = np.minimum(night[1], 1)
    bare = _painted(replace(found, regions=()), seen, ONES)
    dark = tuple(replace(r, streaks=np.zeros_like(r.streaks)) for r in found.regions)
    got = _painted(replace(found, regions=dark), seen, ONES)
    changed = got != bare
    clipped = night[1] >= 1
    assert changed[clipped].mean() > 0.7  # samples of a mosaic miss some pixels of a rim
    beside = np.zeros_like(clipped)
    for y, x in np.ndindex(3, 3):
        beside |= np.roll(clipped, (y - 1, x - 1), (1, 2))
    assert not changed[~beside].any()


def test_a_hole_that_a_demosaic_made_within_a_light_is_filled(
    night: tuple[FloatArray, FloatArray], found: Recovery
) -> None:
    holed = np.minimum(night[1], 1)
    holed[:, 50, 60] = 0.5
    assert (_painted(found, holed, ONES)[:, 50, 60] > 5).all()


def test_no_colour_of_a_light_is_far_below_its_strongest_in_the_output() -> None:
    clipped = np.zeros((COLOURS, 8, 8), np.float32)
    clipped[0, 3, 3] = 1
    turn = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.1, -0.6, 1.5]])
    planes = np.full((COLOURS, 16, 16), 0.2, np.float32)
    Painter(one_light(clipped, (0.5, 0.5)), turn).paint(planes, 0, ONES)
    seen = np.einsum("ij,jyx->iyx", turn, planes)[:, 6:8, 6:8]
    np.testing.assert_allclose(seen[0], 1.6 * 9 - 0.6 * 0.2, rtol=1e-5)
    np.testing.assert_allclose(seen[1:], np.tile(DIMMEST * seen[0], (2, 1, 1)), rtol=1e-4)
    assert (planes[:, 0, 0] == np.float32(0.2)).all()


# ------------------------------------------------------------------------ between cells


def test_what_clipped_is_no_darker_than_both_others_where_one_of_them_was_seen() -> None:
    """Purple rims: green clipped at white, red and blue beside it were seen to be brighter."""
    light = np.array([[1.8, 1.8, 3.0, 1.8], [1.0, 1.0, 1.0, 2.5], [1.5, 0.4, 2.0, 1.5]], np.float32)
    lit = np.array([[0, 0, 1, 0], [1, 1, 1, 1], [0, 0, 1, 0]], np.bool_)
    wanted = light.copy()
    wanted[1, 0] = 1.5
    np.testing.assert_array_equal(_untinted(light, lit), wanted)

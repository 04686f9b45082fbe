"""Rows of counts become depth: in strips as in one, hot and blind pixels told and not believed."""

from collections.abc import Callable

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.guess_pulse import guess_pulse
from camkit.runtime.kinds.spad.pulse import GatedPulse, GaussianPulse
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way, stacked
from camkit.runtime.kinds.spad.time_axis import TimeAxis

HEIGHT, WIDTH = 24, 30
Draw = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def sharpener(axis: TimeAxis, pulse: GatedPulse) -> Sharpener:
    return Sharpener(axis, pulse, Way())


def _times() -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(900 + 10.0 * y + 5.0 * x)


@pytest.fixture
def cube(axis: TimeAxis, draw: Draw) -> np.ndarray:
    counts = draw(axis, _times().ravel(), 8, 0.05, seed=3)
    return counts.reshape(HEIGHT, WIDTH, axis.bins)


@pytest.mark.parametrize("method", ["log", "lsq"])
def test_strips_give_what_the_whole_gives(
    cube: np.ndarray, axis: TimeAxis, pulse: GatedPulse, method: str
) -> None:
    way = Way(method=method)  # type: ignore[arg-type]
    sharpener = Sharpener(axis, pulse, way)
    cube[7, 20] += 3  # hot, and seen by two strips
    whole = sharpener.strip(cube)
    parts = []
    for top in range(0, HEIGHT, 5):
        bottom = min(top + 5, HEIGHT)
        first, end = max(0, top - way.reach_px), min(HEIGHT, bottom + way.reach_px)
        core = slice(top - first, bottom - first)
        parts.append(sharpener.strip(cube[first:end].copy(), core=core))
    found = stacked(parts)
    assert {1, 3} <= set(np.unique(whole.pooled))
    for name in ("valid", "pooled", "hot", "intensity"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
    # matrix products of another height may differ in their last bit
    np.testing.assert_allclose(found.time_of_flight_ps, whole.time_of_flight_ps, atol=0.1)
    np.testing.assert_allclose(found.sigma_ps, whole.sigma_ps, rtol=1e-3)


def test_a_hot_pixel_shows_its_neighbours_and_is_not_believed(
    sharpener: Sharpener, cube: np.ndarray
) -> None:
    cube[7, 20] += 3
    found = sharpener.strip(cube)
    assert np.argwhere(found.hot[0]).tolist() == [[7, 20]]
    assert not found.valid[0, 7, 20]
    around = cube[6:9, 19:22].sum(axis=2)
    assert found.intensity[0, 7, 20] == pytest.approx((around.sum() - around[1, 1]) / 8)
    assert found.time_of_flight_ps[0, 7, 20] == pytest.approx(_times()[7, 20], abs=100)
    # and it does not lend its counts to those around it
    calm = sharpener.strip(np.where(np.arange(WIDTH)[:, None] == 20, 0, cube).astype(np.float32))
    assert found.background[0, 6:9, 19:22].max() < 0.5
    assert calm.background[0, 6:9, 19].max() < 0.5


def test_what_is_said_to_be_hot_is(sharpener: Sharpener, cube: np.ndarray) -> None:
    hot = np.zeros((HEIGHT, WIDTH), bool)
    hot[3, 4] = True
    found = sharpener.strip(cube, hot=hot)
    np.testing.assert_array_equal(found.hot[0], hot)
    with pytest.raises(ContractError, match="more than half cannot be painted over"):
        sharpener.strip(cube, hot=np.ones((HEIGHT, WIDTH), bool))


def test_blind_and_dark_pixels_are_marked(sharpener: Sharpener, cube: np.ndarray) -> None:
    blind = np.zeros((HEIGHT, WIDTH), bool)
    blind[5, 6] = True
    cube[10:17] = 0  # rows that give nothing, more than any square reaches over
    found = sharpener.strip(cube, blind=blind)
    assert not found.valid[0, 5, 6]
    assert not found.valid[0, 10:17].any()
    assert not found.pooled[0, 10:17].any()
    assert not found.amplitude[0, 12:15].any()
    assert np.isfinite(found.time_of_flight_ps).all()
    assert found.valid[0, :9].mean() > 0.9


def test_a_pulse_that_nobody_stated_is_found(axis: TimeAxis) -> None:
    true = GaussianPulse(sigma_ps=55)
    times = np.random.default_rng(0).uniform(500, 2000, 300)
    plain = TimeAxis.regular("histogram", bins=axis.bins, time_bin_ps=20)
    bins = np.broadcast_to(np.arange(plain.bins), (300, plain.bins))
    mean = 60 * plain.shares(true, times, bins) + 0.2
    counts = np.random.default_rng(1).poisson(mean).astype(np.float32)
    assert guess_pulse(counts, plain).sigma_ps == pytest.approx(55, rel=0.04)
    with pytest.raises(ContractError, match=r"photons are too few.*state \[laser\] fwhm_ps"):
        guess_pulse(counts[:2], plain)


def test_a_second_surface_is_told_where_there_is_one(
    axis: TimeAxis, pulse: GatedPulse, draw: Draw
) -> None:
    counts = draw(axis, _times().ravel(), 200, 0.05, seed=3)
    behind = np.zeros((HEIGHT, WIDTH), bool)
    behind[:, 10:20] = True
    counts[behind.ravel()] += draw(axis, _times()[behind] + 350, 100, 0.0, seed=4)
    found = Sharpener(axis, pulse, Way(returns=2)).strip(counts.reshape(HEIGHT, WIDTH, -1))
    assert found.valid.shape == (2, HEIGHT, WIDTH)
    assert found.valid[0].all()
    assert found.valid[1][behind].mean() > 0.99
    assert found.valid[1][~behind].mean() < 0.01
    near, far = found.time_of_flight_ps - _times()
    errors = np.stack([near, far - 350]) / found.sigma_ps
    assert np.mean(np.abs(errors[:, behind]) < 1) == pytest.approx(0.683, abs=0.06)
    assert np.median(found.amplitude[:, behind], axis=1) == pytest.approx([200, 100], rel=0.05)
    # no photons, and the time of the first, where there is none
    alone = ~found.valid[1]
    assert not found.amplitude[1][alone].any()
    np.testing.assert_array_equal(*found.time_of_flight_ps[:, alone])
    plain = Sharpener(axis, pulse, Way()).strip(counts.reshape(HEIGHT, WIDTH, -1))
    np.testing.assert_array_equal(
        plain.time_of_flight_ps[0][alone], found.time_of_flight_ps[0][alone]
    )


def test_an_edge_seen_by_squares_is_not_two_surfaces(
    axis: TimeAxis, pulse: GatedPulse, draw: Draw
) -> None:
    times = np.where(np.arange(WIDTH) < WIDTH // 2, 900.0, 1600.0)[None].repeat(HEIGHT, 0)
    counts = draw(axis, times.ravel(), 25, 0.02, seed=5).reshape(HEIGHT, WIDTH, -1)
    found = Sharpener(axis, pulse, Way(returns=2, pool="3")).strip(counts)
    beside = slice(WIDTH // 2 - 1, WIDTH // 2 + 1)
    assert found.valid[0, :, beside].mean() > 0.9
    assert found.valid[1, :, beside].mean() < 0.05
    right = np.abs(found.time_of_flight_ps[0] - times) < 100
    assert right[found.valid[0]].mean() > 0.95


@pytest.mark.parametrize("side", ["3", "5"])
def test_a_blind_pixel_lends_no_photons_to_squares(
    cube: np.ndarray, axis: TimeAxis, pulse: GatedPulse, side: str
) -> None:
    sharpener = Sharpener(axis, pulse, Way(pool=side))  # type: ignore[arg-type]
    cube[7, 20] = 0
    usual = sharpener.strip(cube).time_of_flight_ps[0]
    cube[7, 20, 40:45] = 400  # a mirror, whose pulse was cut off
    blind = np.zeros((HEIGHT, WIDTH), bool)
    blind[7, 20] = True
    found = sharpener.strip(cube, blind=blind)
    assert not found.valid[0, 7, 20]
    around = np.abs(found.time_of_flight_ps[0] - usual)[5:10, 18:23]
    around[2, 2] = 0
    assert around.max() < 1e-6


def test_a_second_return_of_a_hot_pixel_has_no_photons(
    cube: np.ndarray, axis: TimeAxis, pulse: GatedPulse
) -> None:
    sharpener = Sharpener(axis, pulse, Way(returns=2))
    hot = np.zeros((HEIGHT, WIDTH), bool)
    hot[3, 4] = True
    found = sharpener.strip(cube, hot=hot)
    assert found.amplitude[0, 3, 4] > 0
    assert found.amplitude[1, 3, 4] == found.evidence[1, 3, 4] == 0
    assert found.time_of_flight_ps[1, 3, 4] == found.time_of_flight_ps[0, 3, 4]


def test_a_strip_may_hold_hot_rows_that_a_whole_array_could_not(
    cube: np.ndarray, sharpener: Sharpener
) -> None:
    hot = np.zeros((HEIGHT, WIDTH), bool)
    hot[:6] = True
    found = sharpener.strip(cube[:10], hot=hot[:10], core=slice(4, 6))
    assert not found.valid.any()
    assert np.isfinite(found.time_of_flight_ps).all()

"""Neighbours help where a pixel has too few photons, and do not paint over edges or sky."""

import numpy as np
import pytest
from scipy.ndimage import convolve

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fitter
from camkit.runtime.kinds.spad.pooling import Squares, fit_pooled
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

SIDE = 40


@pytest.fixture(scope="module")
def fitter(axis: TimeAxis, pulse: GatedPulse) -> Fitter:
    return Fitter(make_bank(axis, pulse))


def _cube(draw, axis: TimeAxis, photons: float, even: float, seed: int = 0) -> np.ndarray:  # type: ignore[no-untyped-def]
    counts = draw(axis, np.full(SIDE * SIDE, 1300.0), photons, even, seed=seed)
    return np.asarray(counts.reshape(SIDE, SIDE, axis.bins))


@pytest.mark.parametrize("side", [3, 5])
@pytest.mark.parametrize("shape", [(7, 9), (1, 9), (2, 2)])
def test_squares_are_summed_as_written_out(side: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    cube = rng.poisson(3, (*shape, 8)).astype(np.float32)
    sound = rng.random(shape) > 0.3
    weights = np.ones((side, side, 1))
    expected = convolve(np.where(sound[..., None], cube, 0.0), weights, mode="constant")
    squares = Squares(cube, side, sound)
    every = np.arange(sound.size)
    np.testing.assert_array_equal(squares.counts(every), expected.reshape(-1, 8))
    # few pixels are summed one by one
    for row in every:
        few = squares.counts(np.array([row]))
        np.testing.assert_array_equal(few, expected.reshape(-1, 8)[[row]])
    members = convolve(sound[..., None].astype(float), weights, mode="constant")
    np.testing.assert_array_equal(squares.members, np.maximum(members.ravel(), 1))


def test_bright_pixels_stay_alone(fitter: Fitter, axis: TimeAxis, draw) -> None:  # type: ignore[no-untyped-def]
    found = fit_pooled(fitter, _cube(draw, axis, 200, 0.2))
    assert found.valid.all()
    assert (found.side == 1).all()


def test_dim_pixels_take_as_many_neighbours_as_they_need(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw
) -> None:
    cube = _cube(draw, axis, 6, 0.05)
    alone = fit_pooled(fitter, cube, pool="1")
    found = fit_pooled(fitter, cube)
    assert alone.valid.mean() < 0.5
    assert found.valid.mean() > 0.9
    assert set(np.unique(found.side[found.valid])) >= {1, 3}
    errors = np.abs(found.fit.time_of_flight_ps - 1300)[found.valid]
    assert np.mean(errors < found.fit.sigma_ps[found.valid]) == pytest.approx(0.68, abs=0.09)
    # amplitude is that of one pixel whatever the square
    wide = found.side >= 3
    assert np.median(found.fit.amplitude[wide]) == pytest.approx(6, rel=0.2)


def test_sky_stays_empty(fitter: Fitter, axis: TimeAxis, draw) -> None:  # type: ignore[no-untyped-def]
    rates = [
        fit_pooled(fitter, _cube(draw, axis, 0, even, seed)).valid.mean()
        for seed, even in enumerate((0.02, 0.2, 2.0))
    ]
    assert np.mean(rates) <= 2e-3


def test_surfaces_grow_little_over_their_edges(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw
) -> None:
    grown = []
    for seed in range(4):
        cube = _cube(draw, axis, 12, 0.05, seed)
        cube[:, SIDE // 2 :] = _cube(draw, axis, 0, 0.05, seed + 50)[:, SIDE // 2 :]
        valid = fit_pooled(fitter, cube).valid.reshape(SIDE, SIDE)
        assert valid[:, : SIDE // 2].mean() > 0.9
        grown.append(valid[:, SIDE // 2 : SIDE // 2 + 2].mean())
    assert np.mean(grown) < 0.2


def test_silence_in_a_chosen_square_refutes_bright_surfaces_only(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw
) -> None:
    cube = _cube(draw, axis, 2, 0.002)
    # pixels of a dim surface from which nothing came have what their square shows
    assert fit_pooled(fitter, cube, pool="5").valid.mean() > 0.95
    assert fit_pooled(fitter, cube, pool="auto").valid.mean() < 0.9
    bright = _cube(draw, axis, 30, 0.002)
    bright[:, SIDE // 2 :] = 0
    valid = fit_pooled(fitter, bright, pool="5").valid.reshape(SIDE, SIDE)
    assert valid[:, : SIDE // 2].mean() > 0.99
    assert not valid[:, SIDE // 2 :].any()


def test_photons_of_another_time_refute_a_chosen_square(  # type: ignore[no-untyped-def]
    fitter: Fitter, axis: TimeAxis, draw
) -> None:
    cube = _cube(draw, axis, 8, 0.002)
    apart = draw(axis, np.full(9, 1900.0), 8, 0.002, seed=4)
    cube[5:35:12, 5:35:12] = apart.reshape(3, 3, -1)
    found = fit_pooled(fitter, cube, pool="5")
    at = found.valid.reshape(SIDE, SIDE)[5:35:12, 5:35:12]
    assert at.mean() < 0.2
    assert found.valid.mean() > 0.95


def test_impossible_wishes_are_refused(fitter: Fitter, axis: TimeAxis) -> None:
    cube = np.zeros((2, 2, axis.bins), np.float32)
    with pytest.raises(ContractError, match="pool must be one of auto, 1, 3, 5; got '2'"):
        fit_pooled(fitter, cube, pool="2")  # type: ignore[arg-type]
    with pytest.raises(ContractError, match=r"must lie in 0\.\.0\.5; got 0\.9"):
        fit_pooled(fitter, cube, false_alarms=0.9)
    assert not fit_pooled(fitter, cube).valid.any()
    assert fit_pooled(fitter, cube[:0]).valid.shape == (0,)

"""Lights are found where streaks tell of them, and none are made up where nothing does."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.convolution import Convolution
from camkit.runtime.kinds.hdr.streaks.descent import (
    BRIGHTEST,
    COARSE_STEPS,
    FAINTEST,
    FINE_STEPS,
    MOST_BEYOND,
    Mask,
    Steps,
    _conjugate_gradients,
    _divergence,
    _System,
    _weight,
    _Weights,
    gradient,
    not_outshining,
    seek_lights,
    usable_cells,
)
from tests.streak_factory import star_kernels, street

SHAPE = (48, 64)
COMPACT_RTOL = 0.2
"""Of the light of a lamp in one cell."""
BROAD_LEAST = 0.6
"""Of the light of lamps of several: their inner cells tell less of themselves than they cost."""
MOST = 1.1
"""No lamp is found brighter than it is, but for what the texture adds."""


def _spread() -> Convolution:
    return Convolution(star_kernels(None).coarse.whole[1], SHAPE)


def _scene(seed: int = 0) -> FloatArray:
    """Give the light of cells of 4 px."""
    return (
        street(4 * SHAPE[0], 4 * SHAPE[1], seed)[1].reshape(SHAPE[0], 4, SHAPE[1], 4).mean((1, 3))
    )


def _seen(lights: FloatArray, scene: FloatArray) -> FloatArray:
    """Give what cells see of lights and of a scene that is known without its veil."""
    return scene + _spread().spread(lights)


def _disc(y: int, x: int, radius: float, light: float) -> FloatArray:
    rows, columns = np.indices(SHAPE)
    return np.where(np.hypot(rows - y, columns - x) <= radius, light, 0).astype(np.float32)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_the_light_of_lamps_on_a_textured_scene_is_found(seed: int) -> None:
    compact = [_disc(14, 20, 0.5, 200), _disc(36, 12, 0.5, 60)]
    broad = [_disc(30, 44, 1.5, 40), _disc(8, 50, 1.0, 20)]
    lights = np.sum(compact + broad, axis=0)
    clipped = lights > 0
    first = np.where(clipped, 2, 0).astype(np.float32)
    found = seek_lights(_seen(lights, _scene(seed)), clipped, _spread(), first, COARSE_STEPS)
    for lamp in compact:
        assert found[lamp > 0].sum() == pytest.approx(lamp.sum(), rel=COMPACT_RTOL)
    for lamp in broad:
        assert BROAD_LEAST < found[lamp > 0].sum() / lamp.sum() < MOST
    assert (found[~clipped] == 0).all()


@pytest.mark.parametrize("guess", [0.3, 1.0, 1.6])
def test_where_the_search_starts_hardly_matters(guess: float) -> None:
    lights = _disc(20, 30, 1.0, 50)
    seen, clipped = _seen(lights, _scene()), lights > 0
    found = seek_lights(seen, clipped, _spread(), guess * lights, COARSE_STEPS)
    assert found.sum() == pytest.approx(lights.sum(), rel=0.05)


@pytest.mark.parametrize(("guess", "most"), [(1.5, 1.6), (5, 1.9), (30, 3.0)])
def test_a_broad_area_barely_above_white_is_not_lit_up(guess: float, most: float) -> None:
    """The same area, twenty times as bright, is."""
    lights = _disc(24, 32, 9, 1.1)
    clipped = lights > 0
    first = np.where(clipped, guess, 0).astype(np.float32)
    dim, bright = (
        seek_lights(_seen(times * lights, _scene()), clipped, _spread(), first, COARSE_STEPS)
        for times in (1, 20)
    )
    assert dim.mean(where=clipped) < most
    assert bright.mean(where=clipped) > 4 * dim.mean(where=clipped)


@pytest.mark.parametrize(("radius", "most"), [(0.5, 2 * FAINTEST), (1.5, 0.7)])
@pytest.mark.parametrize("guess", [2, 30])
def test_clipped_cells_without_streaks_lose_their_light(
    radius: float, most: float, guess: float
) -> None:
    """Where a hot pixel clipped, say."""
    clipped = _disc(24, 32, radius, 1) > 0
    first = np.where(clipped, guess, 0).astype(np.float32)
    found = seek_lights(_scene(), clipped, _spread(), first, COARSE_STEPS)
    assert found.mean(where=clipped) < most


def test_nothing_clipped_is_no_light() -> None:
    nothing = np.zeros(SHAPE, bool)
    found = seek_lights(_scene(), nothing, _spread(), np.ones(SHAPE, np.float32), COARSE_STEPS)
    assert found.dtype == np.float32
    assert (found == 0).all()


def test_everything_clipped_stays_finite_and_within_bounds() -> None:
    every = np.ones(SHAPE, bool)
    found = seek_lights(_scene(), every, _spread(), np.full(SHAPE, 9, np.float32), COARSE_STEPS)
    assert np.isfinite(found).all()
    assert FAINTEST <= found.min() <= found.max() <= BRIGHTEST


@pytest.mark.parametrize("start", [0.5, 0.8, 1.25, 1.6])
def test_finer_steps_bring_a_light_nearer_to_what_it_is(start: float) -> None:
    lights = _disc(20, 30, 1.0, 50)
    seen, clipped = _seen(lights, _scene()), lights > 0
    found = seek_lights(seen, clipped, _spread(), start * lights, FINE_STEPS)
    assert abs(found.sum() / lights.sum() - 1) < 0.9 * abs(start - 1)


def test_no_steps_leave_the_light_as_it_was() -> None:
    lights = _disc(20, 30, 1.0, 50)
    still = Steps(scales=(), rounds=3, root=0.5, price=0.0, dim_price=0.0)
    found = seek_lights(_scene(), lights > 0, _spread(), lights, still)
    np.testing.assert_array_equal(found, lights)


# --------------------------------------------------------------------------- where it starts


def _beyond(guess: FloatArray, seen: FloatArray, clipped: Mask) -> float:
    thrown = _spread().spread(guess)[~clipped]
    return float(np.maximum(thrown - seen[~clipped], 0).sum() / thrown.sum())


def test_a_first_guess_whose_streaks_outshine_the_picture_is_lowered() -> None:
    clipped = _disc(24, 32, 9, 1) > 0
    seen = np.full(SHAPE, 0.05, np.float32)
    guess = np.where(clipped, 300, 0).astype(np.float32)
    found = not_outshining(guess, seen, clipped, _spread())
    assert _beyond(guess, seen, clipped) > 2 * MOST_BEYOND
    assert _beyond(found, seen, clipped) == pytest.approx(MOST_BEYOND, abs=2e-3)
    ratio = found[clipped] / guess[clipped]
    assert np.ptp(ratio) < 1e-6
    assert 0 < ratio[0] < 1


def test_a_guess_that_the_picture_allows_stays() -> None:
    lights = _disc(24, 32, 2, 5)
    seen = _seen(2 * lights, _scene())
    found = not_outshining(lights, seen, lights > 0, _spread())
    np.testing.assert_array_equal(found, lights)


# --------------------------------------------------------------------------- the system


def _system() -> _System:
    rng = np.random.default_rng(4)
    shape = (9, 12)
    return _System(
        spread=Convolution(rng.uniform(0, 0.1, (5, 5)).astype(np.float32), shape),
        weights=_Weights(
            y=rng.uniform(0, 2, (8, 12)).astype(np.float32),
            x=rng.uniform(0, 2, (9, 11)).astype(np.float32),
            excess=rng.uniform(0, 2, shape).astype(np.float32),
        ),
        unit=rng.uniform(0.5, 2, shape).astype(np.float32),
        price=rng.uniform(0.1, 1, shape).astype(np.float32),
    )


def _matrix(system: _System) -> np.ndarray:
    size = system.unit.size
    columns = [system.applied(unit.reshape(system.unit.shape)) for unit in np.eye(size, dtype="f4")]
    return np.array(columns).reshape(size, size).astype(np.float64)


def test_the_matrix_is_symmetric_and_positive() -> None:
    matrix = _matrix(_system())
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-5)
    assert np.linalg.eigvalsh(matrix).min() > 0.05  # the least price is 0.1


def test_conjugate_gradients_solve_it() -> None:
    system = _system()
    wanted = np.random.default_rng(0).normal(size=system.unit.shape).astype(np.float32)
    exact = np.linalg.solve(_matrix(system), wanted.ravel()).reshape(wanted.shape)
    start = np.zeros_like(wanted)
    found = _conjugate_gradients(system, wanted, start, 200)
    np.testing.assert_allclose(found, exact, atol=1e-3 * np.abs(exact).max())
    assert (_conjugate_gradients(system, wanted, start, 0) == start).all()


def test_the_divergence_is_the_transpose_of_thegradient() -> None:
    rng = np.random.default_rng(0)
    image, y, x = (rng.normal(size=shape).astype(np.float32) for shape in ((7, 9), (6, 9), (7, 8)))
    down, across = gradient(image)
    one = np.vdot(down, y) + np.vdot(across, x)
    assert one == pytest.approx(np.vdot(image, _divergence(y, x)), rel=1e-4)


def test_weights_are_those_of_geman_and_mcclure() -> None:
    """Their penalty is r^2 / (1 + r^2), r = rest / scale; a weight is rho' / (2 rest)."""
    rest, scale = np.linspace(-0.3, 0.3, 7), 0.1

    def penalty(x: np.ndarray) -> np.ndarray:
        return (x / scale) ** 2 / (1 + (x / scale) ** 2)

    step = 1e-6
    slope = (penalty(rest + step) - penalty(rest - step)) / (2 * step)
    weight = _weight(rest.astype(np.float32), scale)
    np.testing.assert_allclose(2 * rest * weight, slope, atol=1e-4)
    assert weight[3] == pytest.approx(scale**-2)


def test_a_mask_grows_by_the_eight_cells_around_each_of_its_own() -> None:
    mask = np.random.default_rng(0).random((11, 13)) < 0.08
    wanted = np.zeros_like(mask)
    for y, x in np.argwhere(mask):
        wanted[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = True
    grown = ~usable_cells(mask)
    np.testing.assert_array_equal(grown, wanted)
    assert mask.any()
    assert not grown.all()

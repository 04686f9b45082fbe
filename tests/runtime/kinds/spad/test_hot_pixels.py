"""Hot pixels are found and painted over; bright and dark ones are left alone."""

import numpy as np
import pytest
from scipy.ndimage import median_filter

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.fit import Fitter
from camkit.runtime.kinds.spad.hot_pixels import (
    NEIGHBOURHOOD_PX,
    _usual,
    find_hot,
    painted_over,
)
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis

SIDE = 16


def test_hot_pixels_are_found_beside_bright_ones(  # type: ignore[no-untyped-def]
    axis: TimeAxis, pulse: GatedPulse, draw
) -> None:
    counts = draw(axis, np.full(SIDE * SIDE, 1200.0), 40, 0.2)
    bright, hot = SIDE * 5 + 5, [SIDE * 9 + 3, SIDE * 15 + 15, 0]
    counts[bright] = draw(axis, np.array([1200.0]), 30_000, 0.2)[0]
    counts[hot] += np.random.default_rng(1).poisson(4.0, (3, axis.bins))
    fit = Fitter(make_bank(axis, pulse)).fit(counts)
    shape = (SIDE, SIDE)
    cube = counts.reshape(*shape, axis.bins)
    found = find_hot(fit.background.reshape(shape), cube, cube.sum(axis=2, dtype=float))
    assert np.flatnonzero(found).tolist() == sorted(hot)


def test_a_pixel_with_two_surfaces_is_not_hot(  # type: ignore[no-untyped-def]
    axis: TimeAxis, pulse: GatedPulse, draw
) -> None:
    counts = draw(axis, np.full(SIDE * SIDE, 700.0), 20, 0.01)
    edge = SIDE * 7 + 4
    counts[edge] += draw(axis, np.array([1900.0]), 30, 0.0)[0]
    fit = Fitter(make_bank(axis, pulse)).fit(counts)
    assert fit.background[edge] > 5 * np.median(fit.background)
    shape = (SIDE, SIDE)
    cube = counts.reshape(*shape, axis.bins)
    assert not find_hot(fit.background.reshape(shape), cube, cube.sum(axis=2, dtype=float)).any()


def test_a_few_counts_in_the_dark_are_no_hot_pixel() -> None:
    cube = np.random.default_rng(0).poisson(0.5 / 16, (200, 200, 16)).astype(np.float32)
    photons = cube.sum(axis=2, dtype=float)
    assert find_hot(photons / 16, cube, photons).sum() == 0


def test_what_is_painted_is_the_mean_of_sound_neighbours() -> None:
    cube = np.random.default_rng(0).poisson(5, (6, 6, 9)).astype(np.float32)
    hot = np.zeros((6, 6), bool)
    hot[0, 0] = hot[2, 2] = hot[2, 3] = True
    found = painted_over(cube, hot)
    np.testing.assert_allclose(found[0, 0], (cube[0, 1] + cube[1, 0] + cube[1, 1]) / 3)
    around = [cube[y, x] for y in (1, 2, 3) for x in (1, 2, 3) if not hot[y, x]]
    np.testing.assert_allclose(found[2, 2], np.mean(around, axis=0), rtol=1e-6)
    np.testing.assert_array_equal(found[~hot], cube[~hot])
    assert painted_over(cube[..., 0], hot).shape == (6, 6)


def test_a_block_of_hot_pixels_is_painted_from_its_rim() -> None:
    cube = np.full((9, 9), 3, np.float32)
    hot = np.zeros((9, 9), bool)
    hot[2:7, 2:7] = True
    cube[hot] = 1000
    np.testing.assert_array_equal(painted_over(cube, hot), 3)


def test_maps_that_cannot_be_are_refused() -> None:
    cube = np.zeros((4, 4), np.float32)
    with pytest.raises(ContractError, match="is 3x4, the picture 4x4"):
        painted_over(cube, np.zeros((4, 3), bool))
    with pytest.raises(ContractError, match="every pixel is hot"):
        painted_over(cube, np.ones((4, 4), bool))


@pytest.mark.parametrize("share", [0.0, 0.05, 0.9])
def test_the_median_around_some_pixels_is_that_of_the_whole_picture(share: float) -> None:
    rng = np.random.default_rng(3)
    background, at = rng.random((30, 40)), rng.random((30, 40)) < share
    whole = median_filter(background, size=NEIGHBOURHOOD_PX, mode="mirror")
    assert np.array_equal(_usual(background, at), whole[at])

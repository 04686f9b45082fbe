"""The shares of depths (linear in 1 / distance, equal without one) and of shifts of focus."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.psf import depth_name, depth_weights, focus_weights
from tests.deep_bundle import deep_psf

DEPTHS_MM = np.array([500.0, 700.0, 1000.0, 1500.0])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(1.0, 1e6), min_size=1, max_size=6, unique=True).map(sorted),
    st.booleans(),
    st.integers(0, 1000).map(lambda step: step / 1000),
)
def test_shares_sum_to_one_and_average_the_vergences_to_that_asked_for(
    depths: list[float], to_infinity: bool, place: float
) -> None:
    depths_mm = np.array([*depths, np.inf] if to_infinity else depths)
    near, far = 1 / depths_mm[0], 1 / depths_mm[-1]
    vergence = far + place * (near - far)
    shares = depth_weights(depths_mm, 1 / vergence if vergence > 0 else np.inf)
    assert shares.min() >= 0
    assert shares.sum() == pytest.approx(1, abs=1e-9)
    assert shares @ (1 / depths_mm) == pytest.approx(vergence, rel=1e-6, abs=1e-15)
    assert np.flatnonzero(shares > 1e-9).size <= 2


def test_a_depth_of_the_psf_has_all_of_the_share() -> None:
    for index, depth_mm in enumerate(DEPTHS_MM):
        np.testing.assert_array_equal(depth_weights(DEPTHS_MM, depth_mm), np.eye(4)[index])


def test_half_way_is_half_way_in_diopters() -> None:
    np.testing.assert_allclose(
        depth_weights(DEPTHS_MM, 1 / (0.5 / 1000 + 0.5 / 1500)), [0, 0, 0.5, 0.5], atol=1e-12
    )
    np.testing.assert_allclose(depth_weights(np.array([1000.0, np.inf]), 2000.0), [0.5, 0.5])


def test_without_a_depth_all_have_the_same_share() -> None:
    np.testing.assert_array_equal(depth_weights(DEPTHS_MM, None), [0.25] * 4)


def test_a_depth_in_metres_may_be_a_rounding_error_beyond_the_last() -> None:
    np.testing.assert_array_equal(depth_weights(np.array([500.0, 1100.0]), 1.1 * 1000), [0, 1])


@pytest.mark.parametrize("depth_mm", [499.0, 1501.0, np.inf, 0.0, -1.0, np.nan])
def test_a_depth_beyond_the_ends_is_refused_by_name(depth_mm: float) -> None:
    with pytest.raises(ContractError, match=r"0\.5 m, 0\.7 m, 1 m, 1\.5 m.*mean kernel"):
        depth_weights(DEPTHS_MM, depth_mm)


def test_another_depth_than_the_only_one_is_refused() -> None:
    with pytest.raises(ContractError, match="the one depth infinity; got 2 m"):
        depth_weights(np.array([np.inf]), 2000.0)


def test_depths_are_named_in_metres() -> None:
    assert [depth_name(d) for d in (700.0, 1500.0, np.inf)] == ["0.7 m", "1.5 m", "infinity"]


@pytest.mark.parametrize("depths_mm", [(0.0, 1000.0), (-5.0, 1000.0), (1000.0, 500.0)])
def test_a_psf_without_increasing_distances_in_front_of_the_lens_is_refused(
    depths_mm: tuple[float, ...],
) -> None:
    psf = deep_psf((500.0, 1000.0))
    with pytest.raises(ContractError, match="depths"):
        replace(psf, depths_mm=np.array(depths_mm))


def test_kernels_between_shifts_are_shared_by_their_neighbours() -> None:
    shifts_um = np.array([-40.0, -10.0, 20.0])
    for focus_um, shares in (
        (0.0, [1, 0, 0, 0]),
        (-10.0, [0, 0, 1, 0]),
        (20.0, [0, 0, 0, 1]),
        (-25.0, [0, 0.5, 0.5, 0]),
        (-5.0, [0.5, 0, 0.5, 0]),
        (15.0, [0.25, 0, 0, 0.75]),
    ):
        np.testing.assert_allclose(focus_weights(shifts_um, focus_um), shares)
    np.testing.assert_array_equal(focus_weights(None, 0.0), [1])


def test_a_focus_that_is_not_known_is_refused() -> None:
    with pytest.raises(ContractError, match="has the nominal focus alone"):
        focus_weights(None, 1.0)
    for focus_um in (-41.0, 20.1, np.nan):
        with pytest.raises(ContractError, match="reaches from a focus of -40 to 20 um; got"):
            focus_weights(np.array([-40.0, 20.0]), focus_um)

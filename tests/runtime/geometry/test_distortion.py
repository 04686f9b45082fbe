import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.distortion import (
    check_distortion,
    distort_points,
    undistort_points,
)

RADIUS_MM = 21.5
PITCH_MM = 5.96e-3
THERE_AND_BACK_PX = 1e-4
RADII = np.linspace(0, RADIUS_MM, 200)


def model(*rows: tuple[float, float, float, float]) -> RadialDistortion:
    filled = rows * 3 if len(rows) == 1 else rows
    return RadialDistortion(coefficients=np.array(filled, dtype=float), radius_mm=RADIUS_MM)


def on_axis_x(radii: np.ndarray) -> np.ndarray:
    return np.stack([radii, np.zeros_like(radii)], axis=-1)


def test_identity_leaves_points_where_they_are() -> None:
    points = np.random.default_rng(0).uniform(-20, 20, (50, 2))
    np.testing.assert_array_equal(distort_points(points, model((1, 0, 0, 0))), points)


def test_distorted_radius_is_the_polynomial_of_equation_6_10() -> None:
    xi, k1, k2, k3 = 1.01, -0.06, 0.012, -0.002
    found = distort_points(on_axis_x(RADII), model((xi, xi * k1, xi * k2, xi * k3)))[:, 0]
    r = RADII / RADIUS_MM
    expected = xi * r * (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) * RADIUS_MM
    np.testing.assert_allclose(found, expected, atol=1e-12)


@given(
    k=st.tuples(st.floats(-0.08, 0.08), st.floats(-0.01, 0.01), st.floats(-0.005, 0.005)),
    xi=st.floats(0.9, 1.1),
    angle_rad=st.floats(0, 6.28),
)
def test_points_distorted_and_undistorted_return(
    k: tuple[float, float, float], xi: float, angle_rad: float
) -> None:
    distortion = model((xi, xi * k[0], xi * k[1], xi * k[2]))
    points = RADII[:, None] * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    there = undistort_points(distort_points(points, distortion), distortion)
    back = distort_points(undistort_points(points * 0.95, distortion), distortion)
    assert np.abs(there - points).max() / PITCH_MM < THERE_AND_BACK_PX
    assert np.abs(back - points * 0.95).max() / PITCH_MM < THERE_AND_BACK_PX


def test_direction_from_the_axis_is_kept() -> None:
    points = np.random.default_rng(1).uniform(-14, 14, (100, 2))
    moved = undistort_points(points, model((1, -0.05, 0, 0)))
    cross = points[:, 0] * moved[:, 1] - points[:, 1] * moved[:, 0]
    assert np.abs(cross).max() < 1e-9


def test_each_colour_has_its_own_distortion() -> None:
    distortion = model((1, 0, 0, 0), (1.01, 0, 0, 0), (1.02, 0, 0, 0))
    point = np.array([[10.0, 0.0]])
    found = [distort_points(point, distortion, channel=c)[0, 0] for c in range(3)]
    np.testing.assert_allclose(found, [10.0, 10.1, 10.2])


def test_model_that_folds_on_the_sensor_is_refused() -> None:
    # r - 0.5 r^3 turns back at r = sqrt(2/3) = 0.816.
    folding = model((1, -0.5, 0, 0))
    with pytest.raises(ContractError, match="folds at"):
        check_distortion(folding, RADIUS_MM)
    check_distortion(folding, RADIUS_MM * 0.5)
    with pytest.raises(ContractError, match="no inverse"):
        undistort_points(on_axis_x(np.array([RADIUS_MM])), folding)


def test_model_with_negative_scale_is_refused() -> None:
    with pytest.raises(ContractError, match="folds"):
        check_distortion(model((-1, 0, 0, 0)), RADIUS_MM)


def with_even(odd: tuple[float, ...], even: tuple[float, ...]) -> RadialDistortion:
    return RadialDistortion(
        coefficients=np.array([odd]), radius_mm=RADIUS_MM, even_coefficients=np.array([even])
    )


def test_even_powers_are_added_to_the_odd_ones() -> None:
    odd, even = (1.01, -0.06, 0.012, -0.002), (0.03, -0.02, 0.004)
    r = RADII / RADIUS_MM
    powers = {1: 1.01, 3: -0.06, 5: 0.012, 7: -0.002, 2: 0.03, 4: -0.02, 6: 0.004}
    expected = sum(factor * r**power for power, factor in powers.items()) * RADIUS_MM
    found = distort_points(on_axis_x(RADII), with_even(odd, even), channel=0)[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-12)
    back = undistort_points(on_axis_x(found), with_even(odd, even), channel=0)[:, 0]
    np.testing.assert_allclose(back, RADII, atol=1e-9)


def test_even_powers_of_nothing_change_no_bit() -> None:
    odd = (1.01, -0.06, 0.012, -0.002)
    for way in (distort_points, undistort_points):
        plain = way(on_axis_x(RADII), model(odd), channel=0)
        np.testing.assert_array_equal(
            way(on_axis_x(RADII), with_even(odd, (0, 0, 0)), channel=0), plain
        )


@pytest.mark.parametrize("fold", [0.6, 0.9, 1.1])
def test_a_fold_by_even_powers_is_found_where_it_is(fold: float) -> None:
    """r - r^4 / (4 fold^3) turns back at `fold`."""
    bent = with_even((1.0, 0.0, 0.0, 0.0), (0.0, -1 / (4 * fold**3), 0.0))
    inside = fold * RADIUS_MM / 1.02  # a picture is warped a little beyond its corner
    with pytest.raises(ContractError, match=f"folds at {fold * RADIUS_MM:.2f} mm"):
        check_distortion(bent, 1.001 * inside)
    reached = RADIUS_MM * fold * 0.75 / 1.02  # r_d at the fold
    check_distortion(bent, 0.99 * reached)


def test_even_powers_for_other_channels_are_refused() -> None:
    with pytest.raises(ContractError, match=r"finite \(1, 3\)"):
        RadialDistortion(
            coefficients=np.array([[1.0, 0, 0, 0]]),
            radius_mm=1.0,
            even_coefficients=np.ones((3, 3)),
        )

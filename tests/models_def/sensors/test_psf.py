"""The kernel of an image point, by the symmetry of its PSF; see also tests/parity."""

import numpy as np
import pytest
import scipy.signal
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.models_def.sensors.forward import blur
from camkit.models_def.sensors.psf import FieldKernels, color_kernels, wavelength_weights
from tests.psf_factory import coma_kernels, frozen_psf, grid_psf, streak_kernel, uniform_psf

ONE = np.array([0.55]), np.ones((1, 1))
X_MM, Y_MM = np.array([-2.0, 0.0, 1.0]), np.array([-1.0, 1.0])
STREAKS = np.stack([streak_kernel(60.0 * i) for i in range(6)]).reshape(2, 3, 21, 21)
FFT_ERROR = 2e-6


def at(kernels: FieldKernels, *points: tuple[float, float]) -> np.ndarray:
    x_mm, y_mm = torch.tensor(points, dtype=torch.float64).unbind(1)
    return kernels.at(x_mm, y_mm).numpy()


def test_kernels_of_a_radial_psf_are_symmetric_and_turn_with_the_azimuth() -> None:
    kernels, heights = coma_kernels()
    tilted = np.roll(kernels, 2, axis=-1)
    found = color_kernels(frozen_psf(tilted, heights, [0.45, 0.55, 0.65]), *ONE)
    np.testing.assert_array_equal(found.kernels, found.kernels.flip(-1))
    down, up, right = at(found, (0, 1.5), (0, -1.5), (1.5, 0))
    np.testing.assert_array_equal(up, down[:, ::-1])
    np.testing.assert_allclose(right, down.transpose(0, 2, 1), atol=1e-6)


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 137.0])
def test_one_sided_streak_stays_on_its_side(turn_deg: float) -> None:
    streak = streak_kernel(turn_deg)
    found = color_kernels(uniform_psf(streak), *ONE)
    for kernel in at(found, (0, 0), (1, 1), (-3, 2)):
        np.testing.assert_allclose(kernel[0], streak, atol=1e-7)


@pytest.mark.parametrize("turn_deg", [0.0, 210.0])
def test_streaks_fall_where_direct_convolution_puts_them(turn_deg: float) -> None:
    streak, scene = streak_kernel(turn_deg), np.zeros((48, 60), np.float32)
    scene[14, 20] = scene[30, 41] = 1
    kernels = color_kernels(uniform_psf(streak), *ONE).at(torch.zeros(1), torch.zeros(1))
    found = blur(torch.from_numpy(scene)[None, None], kernels)[0, 0].numpy()
    np.testing.assert_allclose(
        found, scipy.signal.convolve2d(scene, streak, "valid"), atol=FFT_ERROR
    )


def test_kernels_of_a_grid_are_those_stored_at_its_places() -> None:
    found = color_kernels(grid_psf(STREAKS, X_MM, Y_MM), *ONE)
    for row, y_mm in enumerate(Y_MM):
        for column, x_mm in enumerate(X_MM):
            (kernel,) = at(found, (x_mm, y_mm))
            np.testing.assert_allclose(kernel[0], STREAKS[row, column], atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(x=st.floats(-2, 1), y=st.floats(-1, 1))
def test_between_its_places_a_grid_is_bilinear(x: float, y: float) -> None:
    (kernel,) = at(color_kernels(grid_psf(STREAKS, X_MM, Y_MM), *ONE), (x, y))
    column = [
        np.interp(x, X_MM, STREAKS[row][:, i, j])
        for row in (0, 1)
        for i in (3, 12)
        for j in (9, 17)
    ]
    upper, lower = np.array(column).reshape(2, 2, 2)
    share = (y - Y_MM[0]) / (Y_MM[1] - Y_MM[0])
    picked = kernel[0][np.ix_((3, 12), (9, 17))]
    np.testing.assert_allclose(picked, (1 - share) * upper + share * lower, atol=1e-6)
    assert kernel.sum() == pytest.approx(1, abs=1e-5)


def test_beyond_its_rim_a_grid_goes_on_unchanged() -> None:
    found = color_kernels(grid_psf(STREAKS, X_MM, Y_MM), *ONE)
    beyond, rim = at(found, (9.0, -0.4), (1.0, -0.4))
    np.testing.assert_array_equal(beyond, rim)
    corner, stored = at(found, (-9.0, 9.0), (-2.0, 1.0))
    np.testing.assert_array_equal(corner, stored)


def test_channels_are_as_many_as_rows_of_the_response() -> None:
    psf = uniform_psf(streak_kernel(0), wavelengths_um=(0.5, 0.6))
    found = color_kernels(psf, np.array([0.45, 0.65]), np.ones((5, 2)))
    assert found.kernels.shape == (1, 5, 21, 21)
    with pytest.raises(ContractError, match="response must be"):
        wavelength_weights(psf.wavelengths_um, np.array([0.5]), np.ones((5, 2)))
    with pytest.raises(ContractError, match="every channel needs a response"):
        color_kernels(psf, np.array([0.45, 0.65]), np.zeros((1, 2)))

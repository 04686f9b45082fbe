"""Wiener theory: closed forms, the estimate written out, noise and the best Gaussian."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.sampling import gaussian_psf, make_sampling
from camkit.models_def.kinds.spad.theory import (
    LAGS,
    Covariance,
    best_gaussian,
    covariance_of,
    wiener_error,
)

INF = float("inf")
POINT, BOX = (make_sampling(mode).kernel for mode in ("low_fill", "full_fill"))


def _covariance(of_distance: object) -> Covariance:
    lags = np.arange(-LAGS, LAGS + 1)
    distance = np.hypot(*np.meshgrid(lags, lags))
    return Covariance(values=torch.from_numpy(of_distance(distance)), mean=0.4)  # type: ignore[operator]


@pytest.fixture(scope="module")
def white() -> Covariance:
    return _covariance(lambda r: np.where(r == 0, 0.05, 0.0))


@pytest.fixture(scope="module")
def natural() -> Covariance:
    return _covariance(lambda r: 0.05 * np.exp(-r / 12))


def _kernel(kernel: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(kernel)


def test_of_a_picture_without_structure_one_sub_pixel_in_sixteen_is_known(
    white: Covariance,
) -> None:
    """A sample tells its own sub-pixel; of a mean it tells 1 / 16 of the variance of each."""
    for kernel in (POINT, BOX):
        error = float(wiener_error(_kernel(kernel), white, INF))
        assert error == pytest.approx(0.05 * 15 / 16, rel=1e-5)


def test_noise_as_strong_as_the_signal_halves_what_a_sample_tells(white: Covariance) -> None:
    error = float(wiener_error(_kernel(POINT), white, white.mean / 0.05))
    assert error == pytest.approx(0.05 * (1 - 0.5 / 16), rel=1e-5)


def test_the_error_is_that_of_the_estimate_written_out(natural: Covariance) -> None:
    """Fine pixels of a window of 50x50, every sum explicit."""
    # a kernel that leans to one corner: turned about it is another
    lean = np.linspace(0.2, 1.8, 11)
    kernel, photons, side = gaussian_psf(1.7) * np.outer(lean, lean**2), 300.0, 50
    kernel = (kernel / kernel.sum()).astype(np.float32)
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1)
    flat = places.reshape(-1, 2)
    gaps = flat[:, None] - flat
    every = 0.05 * np.exp(-np.hypot(gaps[..., 0], gaps[..., 1]) / 12)
    middle = 24
    rows = []
    for k in range(-3, 4):
        for j in range(-3, 4):
            row = np.zeros((side, side))
            y, x = middle + 4 * k, middle + 4 * j
            row[y - 5 : y + 6, x - 5 : x + 6] = kernel[::-1, ::-1]
            rows.append(row.ravel())
    see = np.array(rows)
    matrix = see @ every @ see.T + (0.4 / photons + 1e-7 * 0.05) * np.eye(49)
    errors = []
    for y in range(middle - 2, middle + 2):
        for x in range(middle - 2, middle + 2):
            cross = see @ every[y * side + x]
            errors.append(0.05 - cross @ np.linalg.solve(matrix, cross))
    found = float(wiener_error(_kernel(kernel), natural, photons))
    assert found == pytest.approx(np.mean(errors), rel=1e-6)


def test_the_covariance_of_a_wave_is_a_wave() -> None:
    """Of sin(k x): C(d) = cos(k d) / 2 along x, none along y."""
    x = np.arange(600)
    crop = 0.5 + np.sin(2 * np.pi * x / 30) * np.ones((90, 1))
    found = covariance_of([crop])
    lags = np.arange(-LAGS, LAGS + 1)
    expected = 0.5 * np.cos(2 * np.pi * lags / 30)
    np.testing.assert_allclose(found.values[LAGS], expected, atol=0.02)
    np.testing.assert_allclose(found.values[0], found.values[LAGS], atol=1e-9)
    assert found.mean == pytest.approx(0.5, abs=1e-9)


def test_the_best_gaussian_is_better_than_its_neighbours_and_narrower_in_the_dark(
    natural: Covariance,
) -> None:
    sigmas = [best_gaussian(natural, photons) for photons in (INF, 1e4, 300.0)]
    assert sigmas[0] > sigmas[1] + 0.1 > sigmas[2] + 0.3
    for sigma, photons in zip(sigmas, (INF, 1e4, 300.0), strict=True):
        best, *others = (
            float(wiener_error(_kernel(gaussian_psf(s)), natural, photons))
            for s in (sigma, sigma - 0.1, sigma + 0.1)
        )
        assert best <= min(others)


def test_a_plate_gains_in_light(natural: Covariance) -> None:
    plate, bare = (float(wiener_error(_kernel(k), natural, INF)) for k in (gaussian_psf(), POINT))
    assert plate < 0.9 * bare


def test_gradients_make_a_kernel_better(natural: Covariance) -> None:
    logits = torch.log(_kernel(gaussian_psf(1.0))).double().requires_grad_()
    shape = logits.shape

    def error() -> torch.Tensor:
        kernel = torch.softmax(logits.flatten(), 0).reshape(shape)
        return wiener_error(kernel, natural, 1e4)

    before = error()
    (slope,) = torch.autograd.grad(before, logits)
    with torch.no_grad():
        logits -= 0.1 * slope / slope.abs().max()
    assert float(error().detach()) < float(before.detach())


def test_a_covariance_that_reaches_too_little_is_refused() -> None:
    with pytest.raises(ContractError, match=f"must reach {LAGS} sub-pixels"):
        Covariance(values=torch.zeros(11, 11), mean=0.5)
    with pytest.raises(ContractError, match="at least one crop"):
        covariance_of([])

"""Cross-channel deconvolution against dense matrices, slow descent, and the one without a prior."""

import numpy as np
import pytest

from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, to_otf
from camkit.runtime.bank.cross_channel import (
    Colour,
    compared_with,
    cross_channel_filter,
    sharpest_first,
    solved,
)
from camkit.runtime.bank.total_variation import admm_tv_filter
from tests.psf_factory import blur_periodic, gaussian_kernel, psnr_db, with_noise

NOISE = NoiseModel(shot=(2e-4,) * 3, read_variance=(1e-6,) * 3)
SIGMAS_PX = (2.6, 1.0, 2.2)
TINY = 6


def edges_of_all_colours(size=96):
    """Flat patches; the colours of all have one ratio, so edges lie in the same places."""
    patches = np.random.default_rng(4).uniform(0.1, 0.9, (size // 12, size // 12))
    grey = np.kron(patches, np.ones((12, 12)))
    return np.stack([0.7 * grey, grey, 0.4 * grey]).astype(np.float32)


def block_of(scene, sigmas_px=SIGMAS_PX):
    kernels = np.concatenate([gaussian_kernel(sigma)[:1] for sigma in sigmas_px])
    planes = with_noise(blur_periodic(scene, kernels), NOISE, np.random.default_rng(0))
    return Block(samples=planes, otf=to_otf(kernels, scene.shape[-1]))


def tiny_problem(cross=0.02):
    """One colour of a tiny picture, compared with two others."""
    rng = np.random.default_rng(7)
    others = tuple(
        compared_with(rng.uniform(0.2, 2, (TINY, TINY)).astype(np.float32)) for _ in range(2)
    )
    kernel = rng.uniform(0, 1, (1, 3, 3)).astype(np.float32)
    return Colour(
        samples=rng.uniform(0, 1, (TINY, TINY)).astype(np.float32),
        otf=to_otf(kernel / kernel.sum(), TINY)[0],
        rho=0.3,
        tv=0.01,
        cross=cross,
        others=others,
    )


def dense(apply):
    """The matrix of a linear function of (b, b) planes."""
    units = np.eye(TINY * TINY, dtype=np.float32).reshape(-1, TINY, TINY)
    return np.stack([np.asarray(apply(unit), np.float64).ravel() for unit in units], axis=1)


def dense_blur(colour):
    return dense(lambda x: np.fft.irfft2(np.fft.rfft2(x) * colour.otf, s=(TINY, TINY)))


def dense_metric(colour):
    return dense(lambda x: np.fft.irfft2(np.fft.rfft2(x) * colour.metric, s=(TINY, TINY)))


def test_back_is_the_adjoint_of_applied():
    colour = tiny_problem()
    forth = dense(colour.applied)
    units = np.eye(len(forth), dtype=np.float32).reshape(-1, 3, 2, TINY, TINY)
    back = np.stack([colour.back(unit).ravel() for unit in units], axis=1)
    np.testing.assert_allclose(back, forth.T, atol=1e-6)


def test_the_metric_is_above_the_steps_of_the_duals():
    colour = tiny_problem()
    forth = dense(colour.applied)
    gap = dense_metric(colour) - colour.rho * forth.T @ forth
    assert np.linalg.eigvalsh((gap + gap.T) / 2).min() > -1e-5
    assert np.linalg.eigvalsh((gap + gap.T) / 2).max() > 0.1


def test_the_first_round_is_dense_least_squares():
    colour = tiny_problem()
    blur, metric = dense_blur(colour), dense_metric(colour)
    wanted = np.linalg.solve(blur.T @ blur + metric, blur.T @ colour.samples.ravel())
    np.testing.assert_allclose(solved(colour, 1).ravel(), wanted, atol=2e-5)


def test_rounds_are_those_of_dense_matrices():
    """Five rounds in float64 with matrices in place of spectra."""
    colour = tiny_problem()
    blur, metric, forth = dense_blur(colour), dense_metric(colour), dense(colour.applied)
    limits = np.repeat([0.01, 0.02, 0.02], TINY * TINY)
    x = np.zeros(TINY * TINY)
    duals = before = np.zeros(len(forth))
    for _ in range(5):
        pull = forth.T @ (2 * duals - before)
        right = blur.T @ colour.samples.ravel() + metric @ x - pull
        x = np.linalg.solve(blur.T @ blur + metric, right)
        raised = (duals + colour.rho * forth @ x).reshape(3, 2, -1)
        lengths = np.maximum(np.hypot(raised[:, 0], raised[:, 1]), 1e-30)
        keep = np.minimum(limits.reshape(3, -1) / lengths, 1)
        before, duals = duals, (raised * keep[:, None]).ravel()
    np.testing.assert_allclose(solved(colour, 5).ravel(), x, atol=2e-5)


def test_the_cost_falls_to_what_slow_descent_reaches():
    colour = tiny_problem()
    costs = [colour.cost(solved(colour, rounds)) for rounds in (2, 8, 32, 500)]
    assert costs[0] > costs[1] > costs[2] >= costs[3] * (1 - 1e-6)
    blur, forth = dense_blur(colour), dense(colour.applied)
    weights = np.array([0.01, 0.02, 0.02])[:, None]
    x = colour.samples.ravel().astype(np.float64)
    for step in range(20000):
        lines = (forth @ x).reshape(3, 2, -1)
        lengths = np.sqrt(np.square(lines).sum(axis=1) + 1e-8)
        pull = forth.T @ (weights[:, None] * lines / lengths[:, None]).ravel()
        slope = blur.T @ (blur @ x - colour.samples.ravel()) + pull
        x -= 0.3 / (1 + step / 200) * slope
    descended = colour.cost(x.reshape(TINY, TINY).astype(np.float32))
    assert costs[3] <= descended * 1.0001
    assert costs[3] >= descended * 0.98


def test_without_the_prior_it_is_total_variation_alone():
    block = block_of(edges_of_all_colours())
    alone = admm_tv_filter(NOISE, weight=4.0, iterations=12)(block)
    ours = cross_channel_filter(NOISE, tv_weight=4.0, cross_weight=0.0, rounds=12)(block)
    np.testing.assert_allclose(ours, alone, atol=5e-6)


def test_blurred_colours_gain_from_the_sharp_one_which_stays():
    scene = edges_of_all_colours()
    block = block_of(scene)
    alone = admm_tv_filter(NOISE, weight=5.0)(block)
    ours = cross_channel_filter(NOISE, tv_weight=5.0, cross_weight=10.0)(block)
    for blurred in (0, 2):
        assert psnr_db(ours[blurred], scene[blurred]) > psnr_db(alone[blurred], scene[blurred]) + 4
    np.testing.assert_allclose(ours[1], alone[1], atol=5e-6)


def test_a_colour_of_its_own_edges_pays_for_the_prior():
    """The prior is wrong where colours have nothing in common: it must be able to harm."""
    scene = edges_of_all_colours()
    scene[0] = np.rot90(scene[1])
    block = block_of(scene)
    alone, ours = (
        cross_channel_filter(NOISE, tv_weight=5.0, cross_weight=weight)(block)
        for weight in (0.0, 20.0)
    )
    assert psnr_db(ours[0], scene[0]) < psnr_db(alone[0], scene[0])


def test_a_share_of_the_same_picture_costs_nothing():
    light = np.random.default_rng(1).uniform(0.2, 3, (16, 16)).astype(np.float32)
    assert np.abs(compared_with(light).compared(0.3 * light)).max() < 1e-6
    assert np.abs(compared_with(light).compared(light + 1)).max() > 0.1


@pytest.mark.parametrize(
    ("sigmas_px", "order"), [((2.6, 1.0, 2.2), [1, 2, 0]), ((1, 1, 1), [0, 1, 2])]
)
def test_the_sharpest_colour_leads(sigmas_px, order):
    kernels = np.concatenate([gaussian_kernel(sigma)[:1] for sigma in sigmas_px])
    assert sharpest_first(to_otf(kernels, 48)) == order

"""Networks that know the blur, against dense solutions and closed forms."""

import numpy as np
import pytest
import torch
from torch import Tensor

from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.sensors.wiener import to_otf
from tools.methods.kernel_networks import (
    Blurred,
    FeatureWiener,
    TwoStages,
    UnrolledHqs,
    closed_form,
)

SIDE = 16


def blurred(planes: Tensor, kernels: Tensor) -> Blurred:
    noise = torch.full((len(planes), 3), 1e-3)
    otf = to_otf(kernels, (planes.shape[-2], planes.shape[-1]))
    return Blurred(planes=planes, otf=otf, shot=noise, read_variance=noise**2, scale=64.0)


def even_kernels(count: int, side: int = 3) -> Tensor:
    return torch.full((count, 3, side, side), 1 / side**2)


def test_the_closed_form_equals_the_dense_solution() -> None:
    rng = np.random.default_rng(4)
    side, weight = 6, 0.3
    kernel, measured, prior = rng.random((3, 3)), rng.random((side, side)), rng.random((side, side))
    matrix = np.zeros((side, side, side, side))
    for y, x, j, i in np.ndindex(side, side, 3, 3):
        matrix[y, x, (y - j + 1) % side, (x - i + 1) % side] += kernel[j, i]
    dense = matrix.reshape(side**2, side**2)
    normal = dense.T @ dense + weight * np.eye(side**2)
    expected = np.linalg.solve(normal, dense.T @ measured.ravel() + weight * prior.ravel())
    got = closed_form(
        torch.fft.rfft2(torch.from_numpy(measured))[None, None],
        to_otf(torch.from_numpy(kernel)[None, None], (side, side)),
        torch.from_numpy(prior)[None, None],
        torch.full((1, 1, 1, 1), weight, dtype=torch.float64),
    )
    assert np.allclose(got.ravel().numpy(), expected)


def test_the_stabilising_transform_is_that_of_camkit_and_undone() -> None:
    planes = torch.rand(2, 3, SIDE, SIDE)
    one = blurred(planes, even_kernels(2))
    stable = one.stabilised(planes)
    assert torch.allclose(stable, stabilise(planes, one.shot, one.read_variance), atol=1e-6)
    assert torch.allclose(one.linear(stable), planes, atol=1e-5)


@pytest.mark.parametrize("network", [UnrolledHqs, FeatureWiener, TwoStages])
def test_gradients_reach_all_that_is_learned_and_the_shape_stays(network: type) -> None:
    torch.manual_seed(3)
    one = network()
    for parameter in one.parameters():
        torch.nn.init.normal_(parameter, std=0.05)
    restored = one(blurred(torch.rand(2, 3, SIDE, 2 * SIDE), even_kernels(2)))
    assert restored.shape == (2, 3, SIDE, 2 * SIDE)
    restored.square().mean().backward()
    assert all(
        p.grad is not None and bool(p.grad.isfinite().all()) and bool(p.grad.any())
        for p in one.parameters()
    )


def test_a_new_feature_wiener_is_a_wiener_filter_of_the_planes() -> None:
    torch.manual_seed(3)
    network, one = FeatureWiener(), blurred(torch.rand(1, 3, SIDE, SIDE), even_kernels(1))
    level, planes = one.level, one.planes
    power = (planes / level).var((-2, -1), keepdim=True)
    nsr = np.e * one.variance / level.square() / power
    spectrum = torch.fft.rfft2(planes) * one.otf.conj() / (one.otf.abs().square() + nsr)
    expected = torch.fft.irfft2(spectrum, s=one.size)
    assert torch.allclose(network(one), one.stabilised(expected), atol=1e-5)

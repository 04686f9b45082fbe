import numpy as np
import pytest
import scipy.signal
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.sensors.forward import block_centres_px, blur, scatter

FFT_ERROR = 2e-6


def random(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(seed))


def kernels(*shape: int) -> Tensor:
    values = random(*shape, seed=1)
    return values / values.sum(dim=(-2, -1), keepdim=True)


@pytest.mark.parametrize("side", [1, 5, 8])
def test_blur_is_the_valid_convolution(side: int) -> None:
    planes, k = random(2, 3, 20, 30), kernels(2, 3, side, side)
    found = blur(planes, k).numpy()
    for b in range(2):
        for c in range(3):
            expected = scipy.signal.convolve2d(planes[b, c].numpy(), k[b, c].numpy(), "valid")
            np.testing.assert_allclose(found[b, c], expected, atol=FFT_ERROR)


def test_blur_passes_the_slopes_of_a_convolution() -> None:
    planes = random(2, 3, 11, 14).double().requires_grad_()
    k = random(1, 3, 3, 4, seed=2).double().requires_grad_()
    assert torch.autograd.gradcheck(blur, (planes, k))
    assert torch.autograd.gradcheck(lambda k: blur(planes.detach(), k), (k,))
    with pytest.raises(ContractError, match="do not match"):
        blur(random(2, 3, 9, 9), kernels(4, 3, 3, 3))


def test_one_kernel_everywhere_makes_scatter_a_blur() -> None:
    planes, k = random(3, 48, 70), kernels(3, 9, 9)
    count = [len(block_centres_px(n, 4, step_px=16)) for n in (48, 70)]
    found = scatter(planes, k.expand(*count, 3, 9, 9), step_px=16)
    torch.testing.assert_close(found, blur(planes[None], k[None])[0], atol=FFT_ERROR, rtol=0)


def test_single_pixel_kernel_leaves_the_picture() -> None:
    planes = random(3, 10, 12)
    torch.testing.assert_close(scatter(planes, torch.ones(1, 1, 3, 1, 1)), planes)


def test_gradient_reaches_scene_and_kernels() -> None:
    planes = random(3, 24, 24).double().requires_grad_()
    k = kernels(1, 1, 3, 5, 5).double().requires_grad_()
    assert torch.autograd.gradcheck(scatter, (planes[:, :9, :9], k), fast_mode=True)


def test_kernels_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ContractError, match="exceed"):
        blur(random(1, 3, 4, 4), kernels(1, 3, 5, 5))
    with pytest.raises(ContractError, match="as many kernels"):
        scatter(random(3, 40, 40), kernels(1, 1, 3, 3, 3), step_px=16)

import numpy as np
import pytest
import scipy.signal
import torch
from torch import Tensor

from camkit.contracts import NoiseModel
from camkit.errors import ContractError
from camkit.models_def.sensors.forward import Sensor, block_centres_px, blur, expose, scatter

FFT_ERROR = 2e-6
ONE_DN = 1 / (4095 - 256)


def sensor(shot: float = 1e-3, read_variance: float = 1e-6, full_well: float = 9.0) -> Sensor:
    return Sensor(
        cfa="RGGB",
        gains=(2.0, 1.0, 1.5),
        noise=NoiseModel(shot=(shot,) * 3, read_variance=(read_variance,) * 3),
        full_well=full_well,
        black_level=256.0,
        white_level=4095.0,
    )


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


def test_noise_has_the_variance_of_the_model() -> None:
    planes = torch.full((1, 3, 400, 400), 0.2)
    normal = torch.randn(1, 400, 400, generator=torch.Generator().manual_seed(0))
    camera = sensor()
    green = expose(planes, camera, normal)[0, 0::2, 1::2]
    expected = 1e-3 * 0.2 + 1e-6 + ONE_DN**2 / 12
    assert green.mean().item() == pytest.approx(0.2, abs=5e-4)
    assert green.var().item() == pytest.approx(expected, rel=0.03)


def test_signal_clips_at_white_and_at_the_full_well() -> None:
    bright = torch.full((1, 3, 4, 4), 5.0)
    assert torch.equal(expose(bright, sensor()), torch.ones(1, 4, 4))
    half = expose(bright, sensor(full_well=0.5))
    torch.testing.assert_close(half, torch.full((1, 4, 4), 0.5), atol=ONE_DN, rtol=0)


def test_recorded_levels_are_whole_dn() -> None:
    recorded = expose(random(1, 3, 8, 8), sensor()) / ONE_DN
    torch.testing.assert_close(recorded, recorded.round(), atol=1e-3, rtol=0)


def test_gradients_pass_clipping_and_rounding() -> None:
    planes = torch.tensor([0.2, 5.0]).repeat(8).reshape(1, 1, 4, 4).repeat(1, 3, 1, 1)
    planes.requires_grad_()
    expose(planes, sensor(), torch.zeros(1, 4, 4)).sum().backward()
    assert planes.grad is not None
    # Each pixel passes its own colour with the inverse of its gain, the others nothing.
    expected = torch.tensor([[0.5, 1.0], [1.0, 1 / 1.5]]).repeat(2, 2)
    torch.testing.assert_close(planes.grad.sum(dim=1)[0], expected)


def test_gradient_reaches_scene_and_kernels() -> None:
    planes = random(3, 24, 24).double().requires_grad_()
    k = kernels(1, 1, 3, 5, 5).double().requires_grad_()
    assert torch.autograd.gradcheck(scatter, (planes[:, :9, :9], k), fast_mode=True)


def test_darkness_without_read_noise_has_finite_gradients() -> None:
    planes = torch.zeros(1, 3, 4, 4, requires_grad=True)
    expose(planes, sensor(read_variance=0.0), torch.ones(1, 4, 4)).sum().backward()
    assert planes.grad is not None
    assert torch.isfinite(planes.grad).all()


def test_kernels_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ContractError, match="exceed"):
        blur(random(1, 3, 4, 4), kernels(1, 3, 5, 5))
    with pytest.raises(ContractError, match="as many kernels"):
        scatter(random(3, 40, 40), kernels(1, 1, 3, 3, 3), step_px=16)

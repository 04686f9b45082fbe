import numpy as np
import torch

from camkit.colorimetry import encode_srgb as encode_array
from camkit.models_def.design.front import Front
from camkit.models_def.design.sensor import Recorder, capture
from camkit.models_def.sensors.tone import encode_srgb


def dot(side: int) -> torch.Tensor:
    kernels = torch.zeros(1, 3, side, side)
    kernels[..., side // 2, side // 2] = 1
    return kernels


def test_a_dot_leaves_the_inner_picture_and_noise_has_its_size() -> None:
    generator = torch.Generator().manual_seed(1)
    sharp = 0.3 + 0.2 * torch.rand(1, 3, 80, 80, generator=generator)
    normal = torch.randn(1, 3, 72, 72, generator=generator)
    clean = capture(sharp, dot(9), Recorder(noise=0.0), normal)
    torch.testing.assert_close(clean, sharp[..., 4:-4, 4:-4], rtol=0, atol=1e-6)
    noisy = capture(sharp, dot(9), Recorder(noise=0.02), normal)
    assert abs(float((noisy - clean).std()) - 0.02) < 5e-4


def test_clipping_lets_gradients_through() -> None:
    sharp = torch.full((1, 3, 9, 9), 2.0, requires_grad=True)
    seen = capture(sharp, dot(1), Recorder(noise=0.0), torch.zeros(1, 3, 9, 9))
    assert float(seen.detach().max()) == 1.0
    seen.sum().backward()  # type: ignore[no-untyped-call]
    assert sharp.grad is not None
    assert bool((sharp.grad == 1).all())


def test_colour_filters_keep_one_colour_a_pixel_and_the_rest_is_interpolated() -> None:
    generator = torch.Generator().manual_seed(3)
    sharp = torch.rand(1, 3, 24, 24, generator=generator, requires_grad=True)
    flat = torch.tensor([0.2, 0.5, 0.7]).reshape(1, 3, 1, 1).expand(1, 3, 24, 24)
    none, grbg = torch.zeros(1, 3, 24, 24), Recorder(noise=0.0, cfa="GRBG")
    # 2x2 cells G R / B G: an even colour stays itself, a texture keeps what was sampled
    torch.testing.assert_close(capture(flat, dot(1), grbg, none), flat, rtol=0, atol=1e-6)
    seen = capture(sharp, dot(1), grbg, none)
    for colour, row, column in ((1, 0, 0), (0, 0, 1), (2, 1, 0), (1, 1, 1)):
        kept = (slice(None), colour, slice(row, None, 2), slice(column, None, 2))
        torch.testing.assert_close(seen[kept], sharp[kept], rtol=0, atol=1e-6)
    assert float((seen[:, 0] - sharp[:, 0]).detach().abs().max()) > 0.1
    seen.sum().backward()  # type: ignore[no-untyped-call]
    assert sharp.grad is not None
    assert bool(torch.isfinite(sharp.grad).all())


def test_the_tone_is_srgb_with_a_finite_slope_everywhere() -> None:
    values = torch.tensor([-0.1, 0.0, 1e-4, 0.0031308, 0.2, 1.0], requires_grad=True)
    found = encode_srgb(values)
    wanted = encode_array(values.detach().numpy()[1:])
    np.testing.assert_allclose(found.detach().numpy()[1:], wanted, atol=1e-6)
    found.sum().backward()  # type: ignore[no-untyped-call]
    assert values.grad is not None
    assert bool(torch.isfinite(values.grad).all())


def test_without_noise_the_wiener_front_undoes_the_blur() -> None:
    generator = torch.Generator().manual_seed(2)
    side, kernel = 128, 9
    rough = torch.rand(1, 3, side // 8, side // 8, generator=generator)
    sharp = torch.nn.functional.interpolate(rough, size=(side, side), mode="nearest")
    line = torch.exp(-0.5 * (torch.arange(-4, 5) / 0.8) ** 2)
    blur = (torch.outer(line, line) / line.sum() ** 2).expand(1, 3, kernel, kernel)
    inner = side - kernel + 1
    seen = capture(sharp, blur, Recorder(noise=0.0), torch.zeros(1, 3, inner, inner))
    front = Front(kind="wiener", signal_to_noise=1e4)
    planes = front.planes(seen, blur)
    edge = front.margin_px + kernel // 2
    target = encode_srgb(sharp[..., edge:-edge, edge:-edge])
    errors = [float((part - target).square().mean()) for part in planes.split(3, dim=1)]
    assert planes.shape == (1, 6, inner - 64, inner - 64)
    assert errors[1] < 0.02 * errors[0]

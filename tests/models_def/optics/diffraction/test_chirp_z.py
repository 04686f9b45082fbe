import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.chirp_z import zoom_fourier, zoom_fourier_2d


def _slow(field: torch.Tensor, step: float, count: int) -> torch.Tensor:
    n = torch.arange(field.shape[-1], dtype=torch.float64) - (field.shape[-1] - 1) / 2
    k = torch.arange(count, dtype=torch.float64) - (count - 1) / 2
    turns = torch.exp(-2j * math.pi * step * n[:, None] * k[None, :])
    return field.to(torch.complex128) @ turns


@pytest.mark.parametrize(("given", "count"), [(1, 1), (8, 8), (17, 30), (30, 5), (64, 1)])
@pytest.mark.parametrize("step", [1 / 64, 0.013, 0.5, 1.7])
def test_it_is_the_sum_that_it_stands_for(given: int, count: int, step: float) -> None:
    generator = torch.Generator().manual_seed(3)
    field = torch.randn(2, given, dtype=torch.complex128, generator=generator)
    expected = _slow(field, step, count)
    assert torch.allclose(zoom_fourier(field, step, count), expected, atol=1e-11)
    coarse = zoom_fourier(field.to(torch.complex64), step, count)
    assert coarse.dtype == torch.complex64
    assert torch.allclose(coarse.to(torch.complex128), expected, atol=2e-5)


def test_with_the_steps_of_a_dft_it_is_one() -> None:
    field = torch.randn(31, dtype=torch.complex128, generator=torch.Generator().manual_seed(1))
    shifted = torch.fft.fftshift(torch.fft.fft(torch.fft.ifftshift(field)))
    assert torch.allclose(zoom_fourier(field, 1 / 31, 31), shifted, atol=1e-12)


def test_rows_and_columns_are_transformed_alike() -> None:
    field = torch.randn(9, 9, dtype=torch.complex128, generator=torch.Generator().manual_seed(2))
    expected = _slow(_slow(field, 0.07, 5).T, 0.07, 5).T
    assert torch.allclose(zoom_fourier_2d(field, 0.07, 5), expected, atol=1e-12)


def test_gradients_flow() -> None:
    field = torch.randn(6, dtype=torch.complex128, requires_grad=True)
    assert torch.autograd.gradcheck(lambda f: zoom_fourier(f, 0.11, 4), (field,))


@pytest.mark.parametrize(
    ("field", "count"), [(torch.ones(3), 3), (torch.ones(3, dtype=torch.complex64), 0)]
)
def test_what_is_no_field_is_refused(field: torch.Tensor, count: int) -> None:
    with pytest.raises(ContractError, match="complex"):
        zoom_fourier(field, 0.1, count)

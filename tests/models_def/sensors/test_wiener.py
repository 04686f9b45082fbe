"""The OTF of a periodic block."""

import pytest
import torch

from camkit.models_def.sensors.wiener import to_otf


@pytest.mark.parametrize("size", [(5, 7), (9, 4), (33, 40)])
def test_an_otf_blurs_a_periodic_block_however_wide_the_kernel(size: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(3)
    kernel = torch.rand(1, 1, 13, 11, generator=generator, dtype=torch.float64)
    block = torch.rand(1, 1, *size, generator=generator, dtype=torch.float64)
    found = torch.fft.irfft2(torch.fft.rfft2(block) * to_otf(kernel, size), s=size)
    wanted = torch.zeros_like(block)
    for row in range(13):
        for column in range(11):
            moved = torch.roll(block, (row - 6, column - 5), dims=(-2, -1))
            wanted += kernel[0, 0, row, column] * moved
    torch.testing.assert_close(found, wanted)

"""Kernels of image points, turned to their azimuth: torch with gradients, numpy without."""

import numpy as np
import pytest
import torch

from camkit.models_def.sensors.turned_kernels import turned_at
from camkit.runtime.bank.psf import FieldKernels
from tests.psf_factory import coma_kernels

KERNELS, HEIGHTS_MM = coma_kernels()
LOOKUP_TOLERANCE = 1e-6
POINTS_MM = np.concatenate(
    [
        [[0, 0], [0, 1], [1, 0], [-1, 0], [0, -1], [0, -9], [9, 0.3], [-2, 1.5]],
        np.random.default_rng(1).uniform(-2.5, 2.5, (40, 2)),
    ]
)


@pytest.mark.parametrize("fields", [1, len(HEIGHTS_MM)])
@pytest.mark.parametrize("channels", [1, 3, 7])
def test_kernels_of_image_points_agree(fields: int, channels: int) -> None:
    kernels = np.repeat(KERNELS[-fields:, :1], channels, axis=1).astype(np.float32)
    kernels *= np.random.default_rng(channels).uniform(0.5, 1, kernels.shape).astype(np.float32)
    kernels /= kernels.sum((-2, -1), keepdims=True)
    heights_mm = HEIGHTS_MM[:fields]
    theirs = FieldKernels(kernels=kernels, field_heights_mm=heights_mm)
    x_mm, y_mm = torch.from_numpy(POINTS_MM).unbind(1)
    batch = turned_at(torch.from_numpy(kernels), torch.from_numpy(heights_mm), x_mm, y_mm)
    for (x, y), kernel in zip(POINTS_MM, batch.numpy(), strict=True):
        np.testing.assert_allclose(kernel, theirs.at(x, y), atol=LOOKUP_TOLERANCE)


def test_gradients_reach_the_kernels() -> None:
    kernels = torch.from_numpy(KERNELS.astype(np.float32)).requires_grad_()
    at = torch.tensor([1.0]), torch.tensor([-0.7])
    turned_at(kernels, torch.from_numpy(HEIGHTS_MM), *at)[..., 3, 5].sum().backward()
    assert kernels.grad is not None
    assert kernels.grad.abs().sum() > 0

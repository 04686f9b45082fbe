import numpy as np
import pytest
import torch

from camkit.models_def.sensors import psf as torch_psf
from camkit.runtime.bank import psf as numpy_psf
from tests.deep_bundle import deep_psf
from tests.psf_factory import coma_kernels, frozen_psf

KERNELS, HEIGHTS_MM = coma_kernels()
LOOKUP_TOLERANCE = 1e-6


def test_colour_kernels_agree():
    psf = frozen_psf(KERNELS, HEIGHTS_MM, [0.45, 0.55, 0.65])
    rng = np.random.default_rng(0)
    for count in (1, 2, 31):
        wavelengths_um = np.sort(rng.uniform(0.42, 0.68, count))
        response = rng.random((3, count))
        np.testing.assert_allclose(
            torch_psf.color_kernels(psf, wavelengths_um, response).numpy(),
            numpy_psf.color_kernels(psf, wavelengths_um, response),
            atol=LOOKUP_TOLERANCE,
        )


@pytest.mark.parametrize("depth_mm", [None, 500.0, 800.0, 2000.0])
def test_colour_kernels_of_several_depths_agree(depth_mm):
    psf, wavelengths_um = deep_psf(), np.linspace(0.42, 0.68, 5)
    response = np.random.default_rng(4).random((3, 5))
    np.testing.assert_allclose(
        torch_psf.color_kernels(psf, wavelengths_um, response, depth_mm=depth_mm).numpy(),
        numpy_psf.color_kernels(psf, wavelengths_um, response, depth_mm=depth_mm),
        atol=LOOKUP_TOLERANCE,
    )


def test_kernels_of_image_points_agree():
    rng = np.random.default_rng(1)
    points = rng.uniform(-2.5, 2.5, (40, 2))
    points[:6] = [[0, 0], [0, 1], [1, 0], [-1, 0], [0, -1], [0, -9]]
    batch = torch_psf.kernel_at(
        torch.from_numpy(KERNELS),
        torch.from_numpy(HEIGHTS_MM),
        torch.from_numpy(points[:, 0]),
        torch.from_numpy(points[:, 1]),
    ).numpy()
    for (x_mm, y_mm), kernel in zip(points, batch, strict=True):
        np.testing.assert_allclose(
            kernel, numpy_psf.kernel_at(KERNELS, HEIGHTS_MM, x_mm, y_mm), atol=LOOKUP_TOLERANCE
        )


def test_one_field_agrees():
    batch = torch_psf.kernel_at(
        torch.from_numpy(KERNELS[-1:]), torch.zeros(1), -torch.ones(1), torch.ones(1)
    )
    np.testing.assert_allclose(
        batch[0].numpy(),
        numpy_psf.kernel_at(KERNELS[-1:], np.zeros(1), -1.0, 1.0),
        atol=LOOKUP_TOLERANCE,
    )

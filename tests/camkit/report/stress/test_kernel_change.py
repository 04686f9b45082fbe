"""Kernels turn and grow about their middle."""

import numpy as np
import pytest

from camkit.report.stress.kernel_change import transform_kernels
from camkit.report.stress.score import Judge
from camkit.runtime.twin.light import with_kernels
from tests.psf_factory import coma_kernels, gaussian_kernel


def test_turned_by_a_right_angle_and_back_kernels_are_what_they_were() -> None:
    kernel = coma_kernels(2)[0][1]
    turned = transform_kernels(kernel, 1.0, np.pi / 2)
    np.testing.assert_allclose(turned, np.rot90(kernel, -1, axes=(1, 2)), atol=1e-6)
    np.testing.assert_allclose(transform_kernels(kernel, 1.0, 0.0), kernel, atol=1e-7)


@pytest.mark.parametrize("scale", [0.8, 1.25])
@pytest.mark.parametrize("axis", [0, 1])
def test_scaled_kernels_have_the_scaled_width(scale: float, axis: int) -> None:
    kernel = gaussian_kernel(2.5, radius_px=15)[:, 2:-2]  # wider than high
    scaled = transform_kernels(kernel, scale, 0.0)[0]
    half = scaled.shape[1 - axis] // 2
    x = np.arange(-half, half + 1)
    variance = (scaled.sum(axis=axis) * x**2).sum() / scaled.sum()
    assert np.sqrt(variance) == pytest.approx(2.5 * scale, rel=0.01)


def test_changed_kernels_keep_all_light(judge: Judge) -> None:
    lens = with_kernels(judge.rig.lens, lambda k: transform_kernels(k, 1.3, 0.5) - 0.001)
    kernels = lens.kernels_at(0.3, 0.2)
    np.testing.assert_allclose(kernels.sum(axis=(1, 2)), 1, rtol=1e-5)
    assert kernels.min() >= 0

"""Kernels at another pitch hold the light that falls into each pixel."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.calibration.psf_import.kernel_resampling import (
    for_sensor,
    resampled_kernels,
    window,
    with_pitch,
)
from camkit.models_def.optics.measured import measured_psf


def one_place():
    kernels = np.random.default_rng(2).random((3, 9, 9))
    return measured_psf(kernels, pixel_pitch_um=4.0, wavelengths_um=(0.46, 0.54, 0.6))


@pytest.mark.parametrize("factor", [2, 3, 4])
def test_coarser_pixels_sum_the_samples_that_fall_into_them(factor):
    """Against every sample split into 2 * factor squares, each put where its middle lies."""
    kernel = np.random.default_rng(0).random((9, 9))
    fine = np.repeat(np.repeat(kernel, 2 * factor, 0), 2 * factor, 1) / (2 * factor) ** 2
    found = resampled_kernels(kernel, 1 / factor)
    places = (np.arange(len(fine)) + 0.5) / (2 * factor) - 4.5
    at = np.floor(places / factor + 0.5).astype(int) + len(found) // 2
    slow = np.zeros_like(found)
    np.add.at(slow, np.ix_(at, at), fine)
    np.testing.assert_allclose(found, slow, atol=1e-12)


def test_the_own_pitch_keeps_the_bits():
    psf = one_place()
    assert with_pitch(psf, psf.pixel_pitch_um) is psf


def test_a_psf_at_another_pitch_is_a_psf_of_the_same_width_in_mm():
    psf = one_place()
    other = with_pitch(psf, psf.pixel_pitch_um / 2)
    assert other.kernels.shape[-1] >= 2 * psf.kernels.shape[-1] - 1
    for one in (psf, other):
        np.testing.assert_allclose(one.kernels.sum((-2, -1)), 1, atol=1e-5)


def test_every_channel_of_a_sensor_gets_the_distortion_of_all():
    psf = one_place()
    bent = replace(psf.distortion, coefficients=np.array([[1.0, 0.1, 0, 0]]))
    fitted = for_sensor(replace(psf, distortion=bent), psf.pixel_pitch_um, 3)
    assert fitted.distortion.coefficients.tolist() == [[1.0, 0.1, 0, 0]] * 3


def test_a_window_cuts_and_fills_about_the_middle():
    kernel = np.arange(25.0).reshape(5, 5)
    assert np.array_equal(window(kernel, 3), kernel[1:4, 1:4])
    assert np.array_equal(window(kernel, 7), np.pad(kernel, 1))

"""The error of a copy's transfer, against a closed form."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from tests.wide_bundle import write_wide_bundle
from tools.capture.simulated import color_sensor
from tools.comparison.copies import GRID_PX, JUDGED_BELOW, transfer_error


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def test_the_frozen_psf_itself_is_off_by_nothing(bundle: Bundle) -> None:
    assert transfer_error(bundle.psf, bundle.psf, color_sensor(bundle)) == 0


def test_kernels_moved_by_a_pixel_are_off_by_the_phase(bundle: Bundle) -> None:
    """|1 - exp(-2 pi i f_y)|, weighted by the power of the transfer: here of points."""
    psf = bundle.psf
    kernels = np.zeros_like(psf.kernels)
    middle = psf.kernels.shape[-1] // 2
    kernels[..., middle, middle] = 1
    points = replace(psf, kernels=kernels)
    moved = replace(psf, kernels=np.roll(kernels, 1, axis=-2))
    fy, fx = np.fft.fftfreq(GRID_PX)[:, None], np.fft.rfftfreq(GRID_PX)[None]
    inside = np.hypot(fy, fx) < JUDGED_BELOW
    wanted = np.sqrt(np.mean(4 * np.sin(np.pi * (fy + 0 * fx)[inside]) ** 2))
    assert transfer_error(points, moved, color_sensor(bundle)) == pytest.approx(wanted, rel=1e-4)

"""The error of a measured PSF: none of the truth, a shift of all colours apart from it."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import FieldKernels
from tests.psf_factory import coma_kernels, frozen_psf
from tools.blur.transfer_error import compare_transfers


def measured_and_truth() -> tuple[FrozenPsf, FieldKernels]:
    """Return a PSF of three colours, blue first, and the same as kernels, red first."""
    psf = frozen_psf(*coma_kernels(), [0.46, 0.54, 0.60])
    truth = FieldKernels(
        kernels=np.ascontiguousarray(psf.kernels[:, 0, ::-1]),
        field_heights_mm=psf.field_heights_mm,
    )
    return psf, truth


def test_the_truth_has_no_error_and_a_blur_has_one() -> None:
    psf, truth = measured_and_truth()
    found = compare_transfers(psf, truth, 1.0)
    assert found.moved_px == pytest.approx(0.0, abs=1e-9)
    assert found.errors == pytest.approx(np.zeros(3), abs=1e-6)
    wide = np.ones_like(psf.kernels) / psf.kernels.shape[-1] ** 2
    assert (compare_transfers(replace(psf, kernels=wide), truth, 1.0).errors > 0.05).all()

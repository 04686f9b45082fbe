"""A sensor's own colours take their own kernels, unmixed."""

import numpy as np
import pytest

from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.calibration.psf_import.own_colours import is_of_own_colours, narrow_response
from camkit.runtime.bank.psf import wavelength_weights

OWN_UM = np.array(WAVELENGTHS_UM)


def test_every_channel_takes_its_own_kernel() -> None:
    weights = wavelength_weights(OWN_UM, *narrow_response(OWN_UM))
    np.testing.assert_allclose(weights, np.eye(3)[::-1], atol=2e-5)


def test_a_response_that_is_linear_between_the_colours_would_mix_them() -> None:
    weights = wavelength_weights(OWN_UM, OWN_UM, np.eye(3)[::-1])
    assert weights[0].tolist() == pytest.approx([0, 1 / 3, 2 / 3])


def test_one_kernel_is_that_of_every_channel() -> None:
    waves, rows = narrow_response(np.array([0.54]))
    assert wavelength_weights(np.array([0.54]), waves, rows).tolist() == [[1.0]]


def test_own_colours_are_known_by_their_wavelengths() -> None:
    assert is_of_own_colours(OWN_UM)
    assert not is_of_own_colours(OWN_UM[:1])
    assert not is_of_own_colours(np.array([0.4861, 0.5876, 0.6563]))

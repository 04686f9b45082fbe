"""The response of a sensor whose own colours kernels were measured in.

A bank weights the kernels of wavelengths by the integral of response times kernel, both linear
between their samples. A response that is 1 at the wavelength of its own kernel and falls to 0 at
the next ones would take a third of its light from these: it has to be narrow.
"""

from typing import Final

import numpy as np

from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.calibration.psf_import.kernel_stack import FloatGrid

HALF_WIDTH_UM: Final = 1e-6


def narrow_response(wavelengths_um: FloatGrid) -> tuple[FloatGrid, FloatGrid]:
    """Return a response that takes one kernel for each channel, and nothing of the others.

    Args:
        wavelengths_um: (channel,) that stand for the channels, increasing.

    Returns:
        (n,) wavelengths, and (channel, n), the longest wavelength first, as red is.
    """
    if wavelengths_um.size == 1:
        return wavelengths_um, np.ones((1, 1))
    knots = wavelengths_um[:, None] + np.array([-HALF_WIDTH_UM, 0.0, HALF_WIDTH_UM])
    peaks = np.kron(np.eye(wavelengths_um.size), [0.0, 1.0, 0.0])
    return knots.ravel(), np.array(peaks[::-1], dtype=np.float64)


def is_of_own_colours(wavelengths_um: FloatGrid) -> bool:
    """Return whether wavelengths stand for the colours of the sensor that measured the kernels."""
    standing_um = np.array(WAVELENGTHS_UM)
    same_shape = wavelengths_um.shape == standing_um.shape
    return same_shape and np.allclose(wavelengths_um, standing_um)

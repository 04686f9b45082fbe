"""The distance of the transfer of a copy of a lens from the frozen one."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import ColorSensor
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import FieldKernels, color_kernels

HEIGHTS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of the largest height that is known."""
GRID_PX: Final = 256
JUDGED_BELOW: Final = 0.3
"""Cycles per pixel; above it lenses of this kind transfer little."""

Transfer = NDArray[np.complex128]


def transfer_error(
    frozen: FrozenPsf, copy: FrozenPsf, sensor: ColorSensor, *, focus_um: float = 0.0
) -> float:
    """Return the relative RMS error of the frozen transfer against that of a copy.

    Args:
        frozen: What methods know; of several depths the mean kernel is taken.
        copy: As traced.
        sensor: Whose colours weight the wavelengths.
        focus_um: Of the unit, where the frozen PSF knows such.
    """
    response = sensor.response_arrays()
    kernels = color_kernels(frozen, *response, focus_um=focus_um)
    return relative_error(transfers(kernels), transfers(color_kernels(copy, *response)))


def relative_error(ours: Transfer, theirs: Transfer) -> float:
    """Return the root of the mean square of the difference over that of `theirs`."""
    wrong, power = (float(np.square(np.abs(part)).sum()) for part in (ours - theirs, theirs))
    return math.sqrt(wrong / power)


def transfers(kernels: FieldKernels) -> Transfer:
    """Return the transfers (height, c, n) at some shares of the largest height."""
    heights_mm = np.array(HEIGHTS) * kernels.field_heights_mm[-1]
    return np.stack([_transfer(kernels.at(0.0, float(at_mm))) for at_mm in heights_mm])


def _transfer(kernels: FloatArray) -> Transfer:
    """Return transfer (c, n) below the highest frequency that counts, about the middle pixel."""
    h, w = kernels.shape[-2:]
    wide = np.zeros((len(kernels), GRID_PX, GRID_PX))
    wide[:, :h, :w] = kernels
    wide = np.roll(wide, (-(h // 2), -(w // 2)), axis=(-2, -1))
    cycles = np.hypot(np.fft.fftfreq(GRID_PX)[:, None], np.fft.rfftfreq(GRID_PX))
    return np.asarray(np.fft.rfft2(wide)[:, cycles < JUDGED_BELOW])

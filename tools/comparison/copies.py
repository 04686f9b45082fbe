"""How far the transfer of a copy of a lens lies off the frozen one."""

from typing import Final

import numpy as np

from camkit.bundle.sensor import ColorSensor
from camkit.contracts import FrozenPsf
from camkit.runtime.bank.blocks import to_otf
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.bank.spectrum import ComplexArray

GRID_PX: Final = 384
JUDGED_BELOW: Final = 0.3
"""Cycles per pixel; above it lenses of this kind transfer little."""


def transfer_error(frozen: FrozenPsf, copy: FrozenPsf, sensor: ColorSensor) -> float:
    """Give the root of the mean |H_copy - H|^2 over that of |H|^2, of all colours and heights.

    Args:
        frozen: What methods know.
        copy: A radial PSF whose field heights are the places of the comparison.
        sensor: Whose colours weight the wavelengths; of several depths the mean kernel is taken.
    """
    known, own = (color_kernels(psf, *sensor.response_arrays()) for psf in (frozen, copy))
    frequency = np.hypot(np.fft.fftfreq(GRID_PX)[:, None], np.fft.rfftfreq(GRID_PX)[None])
    inside = (frequency > 0) & (frequency < JUDGED_BELOW)
    error = power = 0.0
    for height_mm in copy.field_heights_mm.tolist():
        there, nominal = (_transfer(kernels, height_mm)[:, inside] for kernels in (own, known))
        error += float(np.square(np.abs(there - nominal)).sum(dtype=np.float64))
        power += float(np.square(np.abs(nominal)).sum(dtype=np.float64))
    return float(np.sqrt(error / power))


def _transfer(kernels: FieldKernels, height_mm: float) -> ComplexArray:
    return to_otf(kernels.at(0.0, height_mm), GRID_PX)

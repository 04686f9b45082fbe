"""Measures of how alike the PSFs of a lens are over its depths.

A filter that is told no depth has one kernel for all of them, their mean.
"""

from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.analysis.mtf import mtf_of_psf

CYCLES_PER_MM: Final = (5.0, 10.0, 20.0)
_GREEN: Final = 1


def likeness(kernels: Tensor) -> Tensor:
    """Return the correlation (depth,) of kernels with their mean over the depths, 1 for equals.

    Args:
        kernels: (depth, field, 3, k, k); the mean is over fields and colours.
    """
    mean = kernels.mean(0, keepdim=True)
    overlap = (kernels * mean).sum((-2, -1))
    size = (kernels.square().sum((-2, -1)) * mean.square().sum((-2, -1))).sqrt()
    return (overlap / size).mean((1, 2))


def depth_mtf(kernels: Tensor, pitch_um: float) -> Tensor:
    """Return the MTF (depth, frequency) of green along rows and columns, means over the fields.

    Args:
        kernels: (depth, field, 3, k, k).
        pitch_um: Of their pixels.
    """
    cycles = torch.tensor(CYCLES_PER_MM, dtype=kernels.dtype)
    curves = [mtf_of_psf(fields[:, _GREEN, None], pitch_um, cycles) for fields in kernels]
    return torch.stack([(mtf.tangential + mtf.sagittal).mean(0) / 2 for mtf in curves])

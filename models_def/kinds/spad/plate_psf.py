"""The kernel of a plate: trained as a softmax, written as a frozen PSF, read from either.

A softmax of 121 logits is non-negative and of unit sum whatever the logits are, and no weight ever
dies, as squares do at 0.
"""

from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.arrays import FloatArray
from camkit.bundle.psf_file import read_psf, write_psf
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.sampling import (
    FINE_PITCH_UM,
    GAUSSIAN_SIGMA,
    PSF_SIDE,
    gaussian_psf,
)
from camkit.models_def.optics.measured import measured_psf
from camkit.psf import FrozenPsf

LOGITS: Final = "plate.logits"
"""Name of the logits among the weights of a network that is trained with its plate."""
WAVELENGTH_UM: Final = 0.655
"""Of the laser for which the plate of the thesis was made."""
CHECKPOINT: Final = ".pt"


class SoftmaxPsf(nn.Module):
    """A kernel that can be trained; it begins as a Gaussian."""

    def __init__(self, sigma: float = GAUSSIAN_SIGMA) -> None:
        super().__init__()
        self.logits = nn.Parameter(torch.from_numpy(np.log(gaussian_psf(sigma))))

    def forward(self) -> Tensor:
        """Return the (11, 11) kernel."""
        return softmax_psf(self.logits)


def softmax_psf(logits: Tensor) -> Tensor:
    """Return a kernel >= 0 of unit sum, of the shape of its logits."""
    return torch.softmax(logits.flatten(), 0).reshape(logits.shape)


def frozen_psf(kernel: FloatArray) -> FrozenPsf:
    """Return a kernel (11, 11) as a bundle holds it: the same everywhere, on the fine grid."""
    return measured_psf(kernel[None], pixel_pitch_um=FINE_PITCH_UM, wavelengths_um=(WAVELENGTH_UM,))


def write_plate_psf(path: Path, kernel: FloatArray) -> None:
    """Write a kernel (11, 11) as a PSF file."""
    write_psf(path, frozen_psf(kernel))


def read_plate_psf(path: Path) -> FloatArray:
    """Read the kernel (11, 11) of a PSF file, or of the checkpoint it was trained in.

    Raises:
        ContractError: If it holds no such kernel.
        BundleError: If the PSF file is damaged.
    """
    if path.suffix == CHECKPOINT:
        return _of_checkpoint(path)
    psf = read_psf(path)
    if psf.kernels.shape != (1, 1, 1, PSF_SIDE, PSF_SIDE) or psf.symmetry != "uniform":
        raise ContractError(
            f"{path} must hold one kernel of {PSF_SIDE}x{PSF_SIDE}, the same everywhere; got "
            f"{psf.kernels.shape}, {psf.symmetry}"
        )
    if abs(psf.pixel_pitch_um - FINE_PITCH_UM) > 1e-6 * FINE_PITCH_UM:
        raise ContractError(
            f"the kernel of {path} must have samples of {FINE_PITCH_UM:g} um; got "
            f"{psf.pixel_pitch_um:g}"
        )
    # a file's arrays cannot be written to, which torch does not take
    return np.array(psf.kernels[0, 0, 0])


def _of_checkpoint(path: Path) -> FloatArray:
    # the reader of checkpoints asks the kinds for their parts, of which this is one
    from camkit.models_def.training.checkpoint import read_checkpoint

    average = read_checkpoint(path).exported
    if LOGITS not in average:
        raise ContractError(f"{path} is of a network that was not trained with its plate")
    return np.asarray(softmax_psf(average[LOGITS]).numpy(), dtype=np.float32)

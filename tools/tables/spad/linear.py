"""The linear estimate of the runtime, as a method of what is measured at training time."""

import torch
from torch import Tensor

from camkit.bundle.stages import SuperResolve
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.sampling import Sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.training.kind import Restorer
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate


def linear_restorer(told: Sampling, exposure: Exposure) -> Restorer:
    """Return the best linear estimate, at the photons that a picture shows.

    Args:
        told: How the array is believed to sample, which need not be how it does.
        exposure: Of one sub-pixel.
    """
    covariance = PictureCovariance.of(SuperResolve())
    grid = Grid(scale=SCALE, phase=told.phase)
    white = exposure.brighter(told.light).white_counts

    def restore(planes: Tensor) -> Tensor:
        photons = float(planes[:, :1].mean()) * white
        found = linear_estimate(told.kernel, grid, covariance, photons)
        return torch.from_numpy(found(planes[0, :1].numpy()))[None]

    return restore

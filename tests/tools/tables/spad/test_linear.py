"""The runtime's linear estimate among methods of training time."""

import math

import numpy as np
import torch

from camkit.bundle.stages import SuperResolve
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.networks.bicubic import SCALE
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate
from tools.tables.spad.linear import linear_restorer


def test_the_estimate_is_taken_at_the_light_that_the_pixels_collect() -> None:
    full = make_sampling("full_fill")
    planes = torch.from_numpy(np.random.default_rng(0).random((1, 2, 9, 12), np.float32))
    mean = float(planes[:, :1].mean())
    covariance, grid = PictureCovariance.of(SuperResolve()), Grid(scale=SCALE, phase=full.phase)
    for photons, of_pixel in ((10.0, 160 * mean), (math.inf, math.inf)):
        found = linear_restorer(full, Exposure(photons=photons))(planes)
        wanted = linear_estimate(full.kernel, grid, covariance, of_pixel)(planes[0, :1].numpy())
        np.testing.assert_array_equal(found[0].numpy(), wanted)

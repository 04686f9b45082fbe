import numpy as np
import torch

from camkit.contracts import NoiseModel
from camkit.models_def.sensors import stabilise as in_torch
from camkit.runtime.signal import stabilise as in_numpy

TOLERANCE = 1e-6
NOISE = NoiseModel(shot=(4e-5, 2e-5, 3e-5), read_variance=(4e-8, 1e-8, 2e-8))


def test_transform_and_inverse_agree():
    planes = np.random.default_rng(0).random((3, 40, 50), dtype=np.float32) * 1.2 - 0.01
    patch = torch.from_numpy(planes)[None]
    shot, read = torch.tensor([NOISE.shot]), torch.tensor([NOISE.read_variance])
    stable = in_numpy.stabilise(planes, NOISE)
    twin = in_torch.stabilise(patch, shot, read)
    np.testing.assert_allclose(twin[0].numpy(), stable, atol=TOLERANCE)
    np.testing.assert_allclose(
        in_torch.unstabilise(twin, shot, read)[0].numpy(),
        in_numpy.unstabilise(stable, NOISE),
        atol=TOLERANCE,
    )

import numpy as np
import pytest
import torch

from camkit.models_def.sensors import stabilise as in_torch
from camkit.noise import NoiseModel
from camkit.runtime.signal import stabilise as in_numpy

TOLERANCE = 1e-6
SHOT = (4e-5, 2e-5, 3e-5, 1e-5, 6e-5)
READ = (4e-8, 1e-8, 2e-8, 3e-8, 5e-8)


@pytest.mark.parametrize("channels", [1, 2, 3, 5])
def test_transform_and_inverse_agree(channels):
    noise = NoiseModel(shot=SHOT[:channels], read_variance=READ[:channels])
    planes = np.random.default_rng(0).random((channels, 40, 50), dtype=np.float32) * 1.2 - 0.01
    patch = torch.from_numpy(planes)[None]
    shot, read = torch.tensor([noise.shot]), torch.tensor([noise.read_variance])
    stable = in_numpy.stabilise(planes, noise)
    twin = in_torch.stabilise(patch, shot, read)
    np.testing.assert_allclose(twin[0].numpy(), stable, atol=TOLERANCE)
    np.testing.assert_allclose(
        in_torch.unstabilise(twin, shot, read)[0].numpy(),
        in_numpy.unstabilise(stable, noise),
        atol=TOLERANCE,
    )

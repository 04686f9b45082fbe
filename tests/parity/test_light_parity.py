"""The bound on moved light, numpy and torch: one format, one result."""

import numpy as np
import pytest
import torch

from camkit.bundle.light_bound import LightBound
from camkit.models_def.networks import light as trained
from camkit.runtime.network import light as run

SCALE = 64.0
TOLERANCE = 2e-6


@pytest.mark.parametrize("deviations", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("clipped", [False, True])
def test_numpy_and_torch_take_back_the_same_light(deviations: float, clipped: bool) -> None:
    rng = np.random.default_rng(4)
    front = rng.random((3, 40, 56), np.float32)
    output = front + 0.2 * rng.standard_normal(front.shape).astype(np.float32) - 0.05
    unknown = np.zeros((1, 40, 56), np.bool_)
    unknown[0, 12:15, 20:31] = clipped
    bound = LightBound(deviations=deviations, psf_error=0.2, light_error=0.01)

    wanted = trained.bounded(
        torch.from_numpy(output)[None],
        torch.from_numpy(front)[None],
        trained.keep_share(torch.from_numpy(unknown)[None]),
        bound,
        scale=SCALE,
    )[0].numpy()
    kept = run.keep_share(unknown)
    assert (kept is None) != clipped
    made = output.copy()
    added = run.added_light(front, made, kept, bound, scale=SCALE)
    run.take_back(front, made, kept, added.excess)

    np.testing.assert_allclose(made, wanted, rtol=0, atol=TOLERANCE)

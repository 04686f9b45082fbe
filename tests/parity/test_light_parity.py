"""The bound on moved light, numpy and torch: one format, one result."""

import numpy as np
import pytest
import torch

from camkit.bundle.light_bound import LightBound
from camkit.models_def.networks import light as trained
from camkit.runtime.network import light_bound as run

SCALE = 64.0
TOLERANCE = 2e-6


@pytest.mark.parametrize(
    "bound",
    [
        LightBound(),
        LightBound(spread=0.2, keeps_bright=True),
        LightBound(noise=3.0, spread=0.2, light=0.01),
    ],
)
@pytest.mark.parametrize("clipped", [False, True])
def test_numpy_and_torch_take_back_the_same_light(bound: LightBound, clipped: bool) -> None:
    rng = np.random.default_rng(4)
    front = rng.random((3, 40, 56), np.float32)
    output = front + 0.2 * rng.standard_normal(front.shape).astype(np.float32) - 0.05
    bright = np.array([0.4, 0.5, 0.6], np.float32)
    unknown = np.zeros((1, 40, 56), np.bool_)
    unknown[0, 12:15, 20:31] = clipped

    wanted = trained.bounded(
        torch.from_numpy(output)[None],
        torch.from_numpy(front)[None],
        trained.keep_share(torch.from_numpy(unknown)[None]),
        bound,
        scale=SCALE,
        bright=torch.from_numpy(bright)[None],
    )[0].numpy()
    kept = run.keep_share(unknown)
    assert (kept is None) != clipped
    made = output.copy()
    added = run.added_light(front, made, kept, bound, scale=SCALE)
    run.take_back(front, made, kept, added.excess)
    if bound.keeps_bright:
        run.keep_bright(front, made, bright, scale=SCALE)

    np.testing.assert_allclose(made, wanted, rtol=0, atol=TOLERANCE)

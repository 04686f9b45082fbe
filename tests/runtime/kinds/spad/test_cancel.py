"""A wish to stop is asked about often enough in depth to be heard within a second."""

import time
from itertools import pairwise

import numpy as np
import pytest

from camkit.runtime.cancel import cancellable
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import TimeAxis

MOST_BETWEEN_S = 1.0


@pytest.mark.slow
@pytest.mark.parametrize("width_ps", [200.0, 1000.0])
@pytest.mark.parametrize("returns", [1, 2])
def test_depth_asks_for_the_wish_at_least_once_a_second(returns: int, width_ps: float) -> None:
    axis = TimeAxis.regular("histogram", bins=125, time_bin_ps=20.0)
    pulse = GatedPulse(width_ps=width_ps, rc_ps=60.0, sigma_ps=42.5)
    share = axis.shares(pulse, np.array([1000.0]), np.arange(axis.bins)[None])[0]
    mean = np.broadcast_to(4 * share + 0.03, (256, 256, axis.bins))
    cube = np.random.default_rng(0).poisson(mean).astype(np.float32)
    sharpener, asked = Sharpener(axis, pulse, Way(returns=returns)), []

    def wish() -> bool:
        asked.append(time.thread_time())  # of this thread: other programs do not count
        return False

    with cancellable(wish):
        wish()
        sharpener.strip(cube)
        wish()
    gap_s = max(after - before for before, after in pairwise(asked))
    print(f"{len(asked)} asks in {asked[-1] - asked[0]:.1f} s, at most {gap_s:.2f} s apart")
    assert gap_s < MOST_BETWEEN_S

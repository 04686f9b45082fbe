"""Burnt-out light becomes neutral at the level where each channel clips; planes have no such."""

import numpy as np

from camkit.bundle.stages import RaiseClipped
from camkit.runtime.color import recover_highlights
from tests.job_factory import made_job, made_mosaic, made_planes, read_all, run_stage, stream_of

GAINS = (1.7, 1.0, 1.4)


def test_every_band_is_raised_as_the_whole_at_the_gains_of_the_light() -> None:
    light = np.random.default_rng(0).random((3, 300, 40), dtype=np.float32) * 2
    (raised,) = run_stage(
        RaiseClipped(), made_job(made_mosaic(), threads=2), stream_of(light, gains=GAINS)
    )
    wanted = recover_highlights(light, GAINS)
    np.testing.assert_array_equal(read_all(raised.rows(), 77), wanted)
    assert (wanted != light).any()
    assert raised.gains == GAINS


def test_planes_that_come_as_such_pass_through() -> None:
    capture = made_planes()
    taken = stream_of(capture.samples + 5)
    assert run_stage(RaiseClipped(), made_job(capture), taken) == (taken,)

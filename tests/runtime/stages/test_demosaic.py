"""The mosaic becomes three planes row by row as in the whole; planes pass through."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.bundle.stages import Demosaic, Linearise, WhiteBalance
from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.runtime.capture import Capture
from camkit.runtime.job.stream import Stream
from camkit.runtime.signal.demosaic import DemosaicMethod, apply_gains, demosaic
from tests.job_factory import (
    captured,
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    stream_of,
)

GAINS = (2.0, 1.0, 1.5)


def _developed(capture: Capture, method: DemosaicMethod, threads: int) -> Stream:
    """Walk a capture through linearise, white balance and demosaic."""
    job = made_job(capture, threads=threads)
    (light,) = run_stage(Linearise(gives=("light",)), job, captured(capture))
    (balanced,) = run_stage(WhiteBalance(), job, light)
    (planes,) = run_stage(Demosaic(method=method), job, balanced)
    return planes


@pytest.mark.parametrize("method", ["fast", "quality"])
@settings(max_examples=12, deadline=None)
@given(
    height=st.integers(1, 150),
    width=st.integers(1, 40),
    cut=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    cfa=st.sampled_from(CFA_PATTERNS),
)
def test_rows_are_balance_and_demosaic_of_the_whole_bit_for_bit(
    method: DemosaicMethod, height: int, width: int, cut: tuple[float, float], cfa: CfaPattern
) -> None:
    samples = np.random.default_rng(height * 1000 + width).integers(0, 1100, (height, width))
    capture = Capture(
        samples=samples.astype(np.uint16),
        cfa=cfa,
        black_level=np.array([[10, 11], [12, 13]], dtype=np.float32),
        white_level=1000.0,
        white_balance=GAINS,
    )
    mosaic = capture.linear_rows(0, height)
    apply_gains(mosaic, cfa, GAINS)
    whole = demosaic(mosaic, cfa, method)
    top, bottom = sorted(round(share * height) for share in cut)
    if top < bottom:
        planes = _developed(capture, method, threads=2)
        assert planes.plane.channels == ("R", "G", "B")
        np.testing.assert_array_equal(planes.rows().read(top, bottom), whole[:, top:bottom])


@pytest.mark.parametrize("method", ["fast", "quality"])
@pytest.mark.parametrize(("threads", "step"), [(1, 9), (2, 33), (3, 70)])
def test_bands_on_any_number_of_threads_are_the_whole(
    method: DemosaicMethod, threads: int, step: int
) -> None:
    samples = np.random.default_rng(0).integers(64, 1000, (70, 64)).astype(np.uint16)
    capture = made_mosaic(samples=samples, cfa="GBRG")
    whole = read_all(_developed(capture, method, 1).rows())
    np.testing.assert_array_equal(
        read_all(_developed(capture, method, threads).rows(), step), whole
    )


def test_planes_pass_through_untouched() -> None:
    capture = made_planes()
    taken = stream_of(capture.samples)
    assert run_stage(Demosaic(), made_job(capture), taken) == (taken,)


@pytest.mark.parametrize(
    ("asked", "stated", "used"), [(None, "quality", "quality"), ("fast", "quality", "fast")]
)
def test_the_callers_method_wins_over_the_bundles(
    asked: DemosaicMethod | None, stated: DemosaicMethod, used: DemosaicMethod
) -> None:
    mosaic = np.random.default_rng(2).random((1, 20, 24), dtype=np.float32)
    job = made_job(made_mosaic(), demosaic=asked)
    (planes,) = run_stage(Demosaic(method=stated), job, stream_of(mosaic))
    np.testing.assert_array_equal(read_all(planes.rows()), demosaic(mosaic[0], "RGGB", used))

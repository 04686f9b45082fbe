"""The front as rows: bands on any number of threads are parts of the whole, counts included."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.contracts import CFA_PATTERNS, CfaPattern
from camkit.runtime.capture import Capture
from camkit.runtime.signal.demosaic import DemosaicMethod, apply_gains, demosaic
from camkit.runtime.signal.front_rows import FrontRows

GAINS = (2.0, 1.0, 1.5)


def bayer_capture() -> Capture:
    samples = np.random.default_rng(0).integers(300, 500, (70, 64)).astype(np.uint16)
    samples[9::20, 11::20] = 1000  # alone far above all around them: broken
    samples[30:40, 30:40] = 1023  # a light that clips
    return Capture(
        samples=samples,
        cfa="GRBG",
        black_level=np.full((2, 2), 64, dtype=np.float32),
        white_level=1023.0,
    )


def planes_capture() -> Capture:
    samples = np.random.default_rng(1).random((3, 70, 64), dtype=np.float32)
    samples[1, 20, 20] = np.nan
    return Capture(
        samples=samples, cfa=None, black_level=np.zeros(3, dtype=np.float32), white_level=1.0
    )


@pytest.mark.parametrize("capture", [bayer_capture(), planes_capture()], ids=["mosaic", "planes"])
@pytest.mark.parametrize("method", ["fast", "quality"])
@pytest.mark.parametrize(("threads", "step"), [(1, 9), (2, 33), (3, 70)])
def test_bands_on_any_number_of_threads_are_the_whole(
    capture: Capture, method: str, threads: int, step: int
) -> None:
    whole = FrontRows(capture, GAINS, method=method, repair=True)
    wanted = whole.read(0, 70)
    shared = FrontRows(capture, GAINS, method=method, repair=True, threads=threads)
    bands = [shared.read(top, min(top + step, 70)) for top in range(0, 70, step)]
    np.testing.assert_array_equal(np.concatenate(bands, axis=1), wanted)
    assert shared.repaired == whole.repaired > 0
    assert shared.clipped == whole.clipped
    assert shared.clipped_fraction == whole.clipped_fraction


@pytest.mark.parametrize("method", ["fast", "quality"])
@settings(max_examples=12, deadline=None)
@given(
    height=st.integers(1, 150),
    width=st.integers(1, 40),
    cut=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    cfa=st.sampled_from(CFA_PATTERNS),
)
def test_without_repair_rows_are_balance_and_demosaic_of_the_whole_bit_for_bit(
    method: DemosaicMethod, height: int, width: int, cut: tuple[float, float], cfa: CfaPattern
) -> None:
    samples = np.random.default_rng(height * 1000 + width).integers(0, 1100, (height, width))
    capture = Capture(
        samples=samples.astype(np.uint16),
        cfa=cfa,
        black_level=np.array([[10, 11], [12, 13]], dtype=np.float32),
        white_level=1000.0,
    )
    mosaic = capture.linear_rows(0, height)
    apply_gains(mosaic, cfa, GAINS)
    whole = demosaic(mosaic, cfa, method)
    top, bottom = sorted(round(share * height) for share in cut)
    if top < bottom:
        front = FrontRows(capture, GAINS, method=method, repair=False, threads=2)
        np.testing.assert_array_equal(front.read(top, bottom), whole[:, top:bottom])
        assert front.repaired == 0


def test_planes_are_only_white_balanced() -> None:
    capture = replace(planes_capture(), samples=np.full((3, 4, 5), 0.5, dtype=np.float32))
    rows = FrontRows(capture, GAINS, method="fast", repair=False).read(1, 3)
    assert rows.shape == (3, 2, 5)
    assert rows[:, 0, 0].tolist() == [1.0, 0.5, 0.75]


@pytest.mark.parametrize(("threads", "step"), [(1, 70), (2, 33)])
def test_a_hot_pixel_is_known_from_its_neighbours_and_a_clipped_light_is_not(
    threads: int, step: int
) -> None:
    capture = bayer_capture()
    capture.samples[46:55, 15:26] = 400
    capture.samples[50, 20] = 1023  # clipped and alone
    front = FrontRows(capture, GAINS, method="fast", repair=True, threads=threads)
    for top in range(0, 70, step):
        front.read(top, min(top + step, 70))
    clipped, unknown = (rows(0, 70) for rows in (capture.saturated_rows, front.unknown_rows))
    assert clipped[50, 20]
    assert not unknown[50, 20]
    assert unknown[32:38, 32:38].all()
    np.testing.assert_array_equal(np.argwhere(clipped & ~unknown), [[50, 20]])
    np.testing.assert_array_equal(front.unknown_rows(45, 60), unknown[45:60])

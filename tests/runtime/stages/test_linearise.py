"""Digital numbers become light row by row, and clipped samples are counted once."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Linearise
from camkit.runtime.capture import Capture
from tests.job_factory import captured, made_job, made_mosaic, made_planes, read_all, run_stage
from tests.planes_bundle import planes_sensor, write_planes_bundle


def _clipping_mosaic() -> Capture:
    samples = np.random.default_rng(0).integers(300, 500, (70, 64)).astype(np.uint16)
    samples[30:40, 30:40] = 1023
    return made_mosaic(samples=samples, cfa="GRBG")


def _planes() -> Capture:
    samples = np.random.default_rng(1).integers(0, 256, (4, 70, 64)).astype(np.uint8)
    black = np.array([1, 2, 3, 4], np.float32)
    return made_planes(samples=samples, black_level=black, white_level=255.0)


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give a camera of four channels."""
    sensor = planes_sensor(("A", "B", "C", "D"), size_px=None)
    stages = (Linearise(gives=("light",)),)
    return write_planes_bundle(tmp_path_factory.mktemp("four"), stages, sensor=sensor)


@pytest.mark.parametrize("kind", ["mosaic", "planes"])
@pytest.mark.parametrize(("threads", "step"), [(1, 9), (2, 33), (3, 70)])
def test_rows_are_the_light_of_the_capture_wherever_reading_begins(
    four: Bundle, kind: str, threads: int, step: int
) -> None:
    capture = _clipping_mosaic() if kind == "mosaic" else _planes()
    job = made_job(capture, four if kind == "planes" else None, threads=threads)
    light, mask = run_stage(Linearise(), job, captured(capture))
    assert (light.plane.domain, mask.plane.domain) == ("linear", "mask")
    wanted = np.broadcast_to(capture.linear_rows(0, 70), light.shape)
    np.testing.assert_array_equal(read_all(light.rows(), step), wanted)
    clipped = np.broadcast_to(capture.saturated_rows(0, 70), light.shape)
    np.testing.assert_array_equal(read_all(mask.rows(), step), clipped)
    assert job.log.clipped_fraction == clipped.mean() > 0


@pytest.mark.parametrize("first", [0, 33])
def test_a_clipped_sample_is_counted_once_however_readings_overlap(first: int) -> None:
    capture = _clipping_mosaic()
    job = made_job(capture)
    light, _ = run_stage(Linearise(), job, captured(capture))
    rows = light.rows()
    for bottom in range(first + 1, 70, 4):
        rows.read(max(bottom - 8, first), bottom)
    assert job.log.clipped_fraction == capture.saturated_rows(first, bottom).mean()


def test_the_mask_alone_counts_nothing() -> None:
    capture = _clipping_mosaic()
    job = made_job(capture)
    _, mask = run_stage(Linearise(), job, captured(capture))
    assert read_all(mask.rows()).any()
    assert job.log.clipped_fraction == 0


def test_without_a_name_for_the_mask_none_is_given() -> None:
    capture = _clipping_mosaic()
    given = run_stage(Linearise(gives=("light",)), made_job(capture), captured(capture))
    assert len(given) == 1

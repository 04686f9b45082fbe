"""Whose gains, and every sample multiplied by that of its colour."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import WhiteBalance
from camkit.cfa import CFA_PATTERNS, CfaPattern
from camkit.colorimetry import camera_from_rec709
from camkit.runtime.signal.demosaic import apply_gains
from tests.bundle_factory import tiny_sensor
from tests.job_factory import (
    OWN_BALANCE,
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    start,
    stream_of,
)


def test_the_captures_own_white_balance_is_taken(bundle: Bundle) -> None:
    assert start(bundle, made_mosaic()).white_balance == OWN_BALANCE


def test_the_callers_white_balance_wins_over_the_captures(bundle: Bundle) -> None:
    chosen = start(bundle, made_mosaic(), white_balance=(3.0, 1.0, 3.0))
    assert chosen.white_balance == (3, 1, 3)


def test_a_silent_capture_gets_the_white_balance_of_the_bundles_light(bundle: Bundle) -> None:
    made = start(bundle, made_mosaic(white_balance=None))
    sensor = tiny_sensor()
    expected = camera_from_rec709(np.array(sensor.color_matrix))[1]
    np.testing.assert_allclose(made.white_balance, expected)
    assert made.white_balance != (1.0, 1.0, 1.0)
    assert made.job.log.notes == [
        f"the capture states no white balance: {sensor.illuminant} is assumed"
    ]


def test_without_bundle_and_statement_gains_are_1_and_that_is_said() -> None:
    made = start(None, made_mosaic(white_balance=None))
    assert made.white_balance == (1.0, 1.0, 1.0)
    assert made.job.log.notes == [
        "the capture states no white balance: gains of 1 are used, colours may have a cast"
    ]


def test_planes_that_state_none_are_taken_as_they_are(bundle: Bundle) -> None:
    assert start(bundle, made_planes()).white_balance == (1.0, 1.0, 1.0)
    assert start(None, made_planes()).job.log.notes == []


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("step", [1, 7, 64])
def test_rows_of_a_mosaic_get_the_gains_of_their_colours_wherever_reading_begins(
    cfa: CfaPattern, step: int
) -> None:
    light = np.random.default_rng(0).random((1, 64, 96), dtype=np.float32)
    job = made_job(made_mosaic(cfa=cfa))
    (balanced,) = run_stage(WhiteBalance(), job, stream_of(light.copy()))
    wanted = light[0].copy()
    apply_gains(wanted, cfa, OWN_BALANCE)
    np.testing.assert_array_equal(read_all(balanced.rows(), step)[0], wanted)
    np.testing.assert_array_equal(balanced.rows().read(13, 40)[0], wanted[13:40])
    assert balanced.gains == OWN_BALANCE


def test_planes_are_only_multiplied() -> None:
    capture = made_planes(
        samples=np.full((3, 4, 5), 0.5, np.float32), white_balance=(2.0, 1.0, 1.5)
    )
    (balanced,) = run_stage(WhiteBalance(), made_job(capture), stream_of(capture.samples))
    rows = balanced.rows().read(1, 3)
    assert rows.shape == (3, 2, 5)
    assert rows[:, 0, 0].tolist() == [1.0, 0.5, 0.75]


def test_rows_that_others_read_too_are_not_changed() -> None:
    light = np.ones((3, 4, 5), np.float32)
    (balanced,) = run_stage(WhiteBalance(), made_job(made_mosaic()), stream_of(light))
    balanced.rows().read(0, 4)
    np.testing.assert_array_equal(light, 1)


def test_bands_that_roll_are_not_changed_for_whoever_reads_them_again() -> None:
    """Rows read again with an overlap must not get their gains twice."""
    light = np.ones((3, 12, 5), np.float32)
    made = stream_of(light).with_bands(iter(np.split(light, 3, axis=1)))
    (balanced,) = run_stage(WhiteBalance(), made_job(made_mosaic()), made)
    rows = balanced.rows()
    for top in (0, 2, 4):
        np.testing.assert_array_equal(
            rows.read(top, top + 6)[:, :, 0], [[g] * 6 for g in (2, 1, 1.5)]
        )

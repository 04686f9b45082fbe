"""Pictures and depth beside the truth: what cannot be is a fault, what is exact has no error."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.spad_scene import SpadScene
from camkit.report.kinds.spad.stress.spad_score import (
    depth_outcome,
    picture_errors,
    picture_outcome,
)
from camkit.report.kinds.spad.stress.spad_shot import DepthSetting, DepthShot
from camkit.report.stress.score import BEST_DB
from camkit.runtime.kinds.spad.sharpen import Sharpened


@pytest.fixture(scope="module")
def shot(judge: SpadJudge, scene: SpadScene) -> DepthShot:
    return judge.scan(scene, DepthSetting())


@pytest.fixture(scope="module")
def exact(judge: SpadJudge, shot: DepthShot) -> Sharpened:
    """Give what was found, with the true times."""
    found = judge.ways.depths(shot)["linear"]
    return replace(found, time_of_flight_ps=shot.times_ps.copy())


def test_an_equal_picture_is_as_good_as_can_be() -> None:
    truth = np.full((128, 128), 0.4, np.float32)
    found = picture_outcome(picture_errors(truth, truth), 0.0, None)
    assert found.psnr_db == BEST_DB
    assert found.chi2 is None


def test_chi2_of_a_picture_is_its_error_over_the_undisturbed_one() -> None:
    truth = np.zeros((128, 128), np.float32)
    found = picture_outcome(picture_errors(truth + np.float32(0.1), truth), 0.0, 0.005)
    assert found.psnr_db == pytest.approx(20, abs=1e-4)
    assert found.chi2 == pytest.approx(2, rel=1e-4)


def test_what_is_not_a_number_is_a_fault(exact: Sharpened, shot: DepthShot) -> None:
    truth = np.zeros((128, 128), np.float32)
    assert picture_outcome(picture_errors(truth * np.nan, truth), 0.0, None).fault is not None
    broken = replace(exact, time_of_flight_ps=exact.time_of_flight_ps * np.nan)
    assert depth_outcome(broken, shot, 0.0).fault == "NaN or inf in the times"


def test_decibels_of_depth_are_the_span_over_the_mean_error(
    exact: Sharpened, shot: DepthShot
) -> None:
    edges = shot.axis.edges_ps
    off = replace(exact, time_of_flight_ps=exact.time_of_flight_ps + (edges[-1] - edges[0]) / 100)
    found = depth_outcome(off, shot, 0.0)
    assert found.psnr_db == pytest.approx(40)
    assert found.extra["bias_mm"] == pytest.approx(found.extra["mean_error_mm"])


def test_few_believed_sub_pixels_are_a_fault(exact: Sharpened, shot: DepthShot) -> None:
    few = replace(exact, valid=np.zeros_like(exact.valid))
    found = depth_outcome(few, shot, 0.0)
    assert found.fault == "0% of the sub-pixels are believed"
    assert found.chi2 is None


def test_believed_times_of_no_surface_are_a_fault(exact: Sharpened, shot: DepthShot) -> None:
    times = exact.time_of_flight_ps.copy()
    times[:, :, ::10] += 500
    found = depth_outcome(replace(exact, time_of_flight_ps=times), shot, 0.0)
    assert found.fault is not None
    assert "of no surface" in found.fault

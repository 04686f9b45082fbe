"""Every scenario of snapshot HDR takes its captures, and its knob does what it says."""

from collections.abc import Iterator

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.kinds.hdr import PART
from camkit.report.kinds.hdr.judge import HdrJudge, HdrShot, hdr_judge_of
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene, stress_scenes
from camkit.report.stress.stress_run import StressOptions, run_stress, scenarios_for
from tests.hdr_bundle import write_hdr_bundle
from tests.wide_bundle import write_wide_bundle

OWN = {scenario.name: scenario for scenario in PART.stress.scenarios}
STATED = {
    *("streak_clipping", "peak", "plate_rotation", "single_colour", "light_outside"),
    *("streak_like_edges", "wrong_depth", "bit_depth", "noise", "saturated_area", "blob_size"),
}
"""What docs/results/stress.md names."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hdr_bundle(tmp_path_factory.mktemp("hdr"))


@pytest.fixture(scope="module")
def judge(bundle: Bundle) -> HdrJudge:
    return hdr_judge_of(bundle, (), None)


@pytest.fixture(scope="module")
def scene(bundle: Bundle) -> Scene:
    return stress_scenes(bundle, 1)[0]


def _shoot(name: str, judge: HdrJudge, scene: Scene, value: float) -> HdrShot:
    scenario: Scenario = OWN[name]
    assert scenario.shoot is not None
    shot = scenario.shoot(judge, scene, value)
    assert isinstance(shot, HdrShot)
    return shot


def _ends(name: str, judge: HdrJudge, scene: Scene) -> Iterator[HdrShot]:
    for value in (OWN[name].values[0], OWN[name].values[-1]):
        yield _shoot(name, judge, scene, value)


def test_the_kind_brings_its_own_and_stands_in_for_common_ones(bundle: Bundle) -> None:
    assert OWN.keys() == STATED
    chosen = {scenario.name: scenario for scenario in scenarios_for(bundle, None)}
    assert all(chosen[name] is OWN[name] for name in OWN)
    assert "dead_pixels" in chosen


def test_a_camera_without_streaks_takes_none(tmp_path) -> None:
    wide = write_wide_bundle(tmp_path)
    assert {s.applies(wide) for s in OWN.values()} == {"its optics write no streaks"}


@pytest.mark.parametrize("name", sorted(STATED))
def test_every_nominal_value_is_a_capture_with_clipped_lights(
    name: str, judge: HdrJudge, scene: Scene
) -> None:
    shot = _shoot(name, judge, scene, OWN[name].nominal)
    capture = shot.coded.capture
    share = capture.saturated_rows(0, capture.height).mean()
    assert 1e-4 < share < 0.05
    assert np.isfinite(shot.truth).all()


def test_nominal_captures_of_the_same_lights_are_one(judge: HdrJudge, scene: Scene) -> None:
    others = {"blob_size", "streak_clipping", "light_outside", "peak"}
    samples = [
        _shoot(name, judge, scene, OWN[name].nominal).coded.capture.samples
        for name in sorted(STATED - others)
    ]
    for other in samples[1:]:
        np.testing.assert_array_equal(other, samples[0])


def test_larger_lamps_and_longer_exposures_clip_more(judge: HdrJudge, scene: Scene) -> None:
    for name in ("blob_size", "saturated_area", "streak_clipping"):
        least, most = (
            shot.coded.capture.saturated_rows(0, 192).mean() for shot in _ends(name, judge, scene)
        )
        assert most > 3 * least, name


def test_the_truth_has_the_peak_of_its_value(judge: HdrJudge, scene: Scene) -> None:
    for value in (2.0, 1024.0):
        assert _shoot("peak", judge, scene, value).truth.max() == pytest.approx(value, rel=0.02)


def test_lights_have_the_colour_of_their_label(judge: HdrJudge, scene: Scene) -> None:
    for name, channel in (("red", 0), ("green", 1), ("blue", 2)):
        value = float(OWN["single_colour"].labels.index(name))
        truth = _shoot("single_colour", judge, scene, value).truth
        y, x = np.unravel_index(truth.max(axis=0).argmax(), truth.shape[1:])
        assert truth[:, y, x].argmax() == channel


@pytest.mark.parametrize("name", ["plate_rotation", "wrong_depth", "light_outside"])
def test_the_truth_stays_where_streaks_move(name: str, judge: HdrJudge, scene: Scene) -> None:
    scenario = OWN[name]
    nominal = _shoot(name, judge, scene, scenario.nominal)
    moved = _shoot(name, judge, scene, scenario.values[-1])
    np.testing.assert_array_equal(moved.truth, nominal.truth)
    samples = (s.coded.capture.samples.astype(float) for s in (moved, nominal))
    assert np.abs(np.subtract(*samples)).max() > 50


def test_lines_through_lights_are_part_of_the_truth(judge: HdrJudge, scene: Scene) -> None:
    plain, lined = _ends("streak_like_edges", judge, scene)
    added = lined.truth - plain.truth
    # six of half of white, that may cross
    assert 0.4 < added.max() < 6 * 0.5
    assert 0.002 < (added > 0.1).mean() < 0.2


def test_fewer_bits_and_more_noise_reach_the_capture(judge: HdrJudge, scene: Scene) -> None:
    few, many = _ends("bit_depth", judge, scene)
    assert (few.coded.capture.white_level, many.coded.capture.white_level) == (255, 2**14 - 1)
    quiet, loud = _ends("noise", judge, scene)
    assert loud.coded.noise.read_variance[0] > 100 * quiet.coded.noise.read_variance[0]


def test_a_quick_run_says_where_results_fall_below_the_input(bundle: Bundle, tmp_path) -> None:
    options = StressOptions(
        scenarios=scenarios_for(bundle, "plate_rotation,single_colour"),
        scenes=1,
        quick=True,
        out_dir=tmp_path / "stress",
    )
    result = run_stress(bundle, options)
    for row in result.rows:
        assert row["psnr_db"].keys() == {"input", "physics"}
        assert row["extra"].keys() == {"stops_rmse", "unclipped_psnr_db"}
        assert {found["method"] for found in row["breaks"]} == {"physics"}
    assert result.page is not None
    assert "Rotation of the plate" in result.page.read_text(encoding="utf-8")

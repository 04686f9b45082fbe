"""Scenarios of single photons: nothing at the nominal value, more and more away from it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.cli.app import run
from camkit.errors import UnsupportedError
from camkit.report.kinds.spad.stress import STRESS
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.spad_rows import gate_like
from camkit.report.kinds.spad.stress.spad_scene import SpadScene
from camkit.report.kinds.spad.stress.spad_shot import DepthSetting, PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario, all_scenarios
from camkit.runtime.kinds.spad.pulse import GaussianPulse

OWN = {scenario.name: scenario for scenario in STRESS.scenarios}
PLATE = ("plate_rotation", "plate_shift", "defocus", "etch_depth", "active_area", "sample_phase")
LIGHT = ("photons", "dark_map", "dark_unknown", "hot_pixels", "hot_counts")
TIMES = (
    *("depth_photons", "depth_sbr", "depth_hot", "gate_width", "gate_rc"),
    *("orientation", "two_returns", "pile_up", "pile_up_free"),
)


def _shot(scenario: Scenario, judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    assert scenario.shoot is not None
    found = scenario.shoot(judge, scene, value)
    assert isinstance(found, PictureShot)
    return found


def test_these_are_the_scenarios_of_single_photons() -> None:
    assert set(OWN) == {*PLATE, *LIGHT, *TIMES, "sbr", "wrong_photons"}


def test_no_scenario_of_photographs_is_for_arrays_of_single_photons(bundle: Bundle) -> None:
    own = set(OWN)
    taken = {s.name for s in all_scenarios() if s.applies(bundle) is None}
    assert not taken - own
    assert all(scenario.applies(bundle) is None for scenario in OWN.values())


@pytest.mark.parametrize("name", [*PLATE, *LIGHT])
def test_the_nominal_value_counts_what_the_undisturbed_array_does(
    name: str, judge: SpadJudge, scene: SpadScene
) -> None:
    usual = judge.shoot(scene, PictureSetting())
    found = _shot(OWN[name], judge, scene, OWN[name].nominal)
    np.testing.assert_array_equal(found.counts, usual.counts)
    np.testing.assert_array_equal(found.bare, usual.bare)


@pytest.mark.parametrize("name", ["depth_photons", "depth_sbr", "depth_hot", "gate_width"])
def test_the_nominal_value_scans_as_the_undisturbed_array_does(
    name: str, judge: SpadJudge, scene: SpadScene
) -> None:
    usual = judge.scan(scene, DepthSetting())
    scenario = OWN[name]
    assert scenario.shoot is not None
    found = scenario.shoot(judge, scene, scenario.nominal)
    np.testing.assert_array_equal(found.counts, usual.counts)


@pytest.mark.parametrize("name", ["dark_unknown", "hot_counts", "etch_depth", "sample_phase"])
def test_the_far_end_of_a_scenario_is_worse_than_the_nominal_value(
    name: str, judge: SpadJudge, scene: SpadScene
) -> None:
    scenario = OWN[name]
    first, last = (
        scenario.take(judge, scene, value).outcomes["linear"]
        for value in (scenario.nominal, scenario.values[-1])
    )
    assert first.chi2 == pytest.approx(1)
    assert first.psnr_db is not None
    assert last.psnr_db is not None
    assert last.psnr_db < first.psnr_db
    assert last.chi2 == pytest.approx(10 ** ((first.psnr_db - last.psnr_db) / 10), rel=1e-6)


def test_a_shift_of_the_plate_takes_light_alone(judge: SpadJudge, scene: SpadScene) -> None:
    shifted = _shot(OWN["plate_shift"], judge, scene, 2.0)
    usual = judge.shoot(scene, PictureSetting())
    assert shifted.photons[1] == pytest.approx(usual.photons[1] * (12 / 14) ** 2)
    assert shifted.counts.mean() == pytest.approx(usual.counts.mean() * (12 / 14) ** 2, rel=0.01)
    np.testing.assert_array_equal(shifted.bare, usual.bare)


def test_what_networks_are_told_changes_no_linear_estimate(
    judge: SpadJudge, scene: SpadScene
) -> None:
    scenario = OWN["wrong_photons"]
    wrong, right = (
        judge.ways.pictures(_shot(scenario, judge, scene, value)) for value in (10.0, 1.0)
    )
    np.testing.assert_array_equal(wrong["linear"], right["linear"])
    assert "linear" in scenario.rivals


def test_a_gate_taken_for_a_histogram_is_off_by_about_its_length(
    judge: SpadJudge, scene: SpadScene
) -> None:
    found = [OWN["orientation"].take(judge, scene, v).outcomes["linear"] for v in (0.0, 1.0)]
    right, wrong = (o.extra["mean_error_mm"] for o in found)
    assert right < 5
    assert wrong > 15


@pytest.mark.parametrize("name", ["sbr", "gate_rc", "pile_up_free"])
def test_the_worst_value_is_worse_by_the_linear_estimate(
    name: str, judge: SpadJudge, scene: SpadScene
) -> None:
    scenario = OWN[name]
    alone = SpadJudge(judge.studio, replace(judge.ways, networks={}))
    worst = scenario.values[0] if name == "sbr" else scenario.values[-1]
    usual, found = (
        scenario.take(alone, scene, value).outcomes["linear"].psnr_db
        for value in (scenario.nominal, worst)
    )
    assert usual is not None
    assert found is not None
    assert found < usual - 1


def test_a_gate_scan_stands_pile_up_of_half_of_its_cycles(
    judge: SpadJudge, scene: SpadScene
) -> None:
    scenario = OWN["pile_up"]
    alone = SpadJudge(judge.studio, replace(judge.ways, networks={}))
    errors = [
        scenario.take(alone, scene, value).outcomes["linear"].extra["mean_error_mm"]
        for value in (0.01, 0.45)
    ]
    assert errors[1] == pytest.approx(errors[0], rel=0.1)


def test_what_is_no_gate_cannot_be_another() -> None:
    with pytest.raises(UnsupportedError, match="states no gate"):
        gate_like(GaussianPulse(sigma_ps=50), width=2.0)


def test_two_surfaces_are_told_apart_when_far_and_not_when_near(
    judge: SpadJudge, scene: SpadScene
) -> None:
    scenario = OWN["two_returns"]
    alone = SpadJudge(judge.studio, replace(judge.ways, networks={}))
    near, far = (scenario.take(alone, scene, v).outcomes["linear"] for v in (25.0, 600.0))
    assert far.extra["both_share"] > 0.8
    assert far.fault is None
    assert near.extra["both_share"] < 0.5
    assert near.fault is not None


def test_pile_up_is_undone_before_it_is_judged(judge: SpadJudge, scene: SpadScene) -> None:
    shots = [judge.scan(scene, DepthSetting(chance=chance)) for chance in (0.01, 0.7)]
    means = [shot.counts.mean() for shot in shots]
    assert means[1] == pytest.approx(means[0], rel=0.05)


def test_sigma_behind_the_correction_takes_in_that_its_counts_scatter_more(
    judge: SpadJudge, scene: SpadScene
) -> None:
    """As of `camkit process`, which also leaves little pile-up alone."""
    shot = judge.scan(scene, DepthSetting(chance=0.85))
    found, without = (judge.ways.depths(s) for s in (shot, replace(shot, cycles=0)))
    assert set(found) == {"bicubic", "linear", "S"}
    for name, told in found.items():
        wider = np.median(told.sigma_ps / without[name].sigma_ps)
        assert wider > 1.05, name
    assert judge.scan(scene, DepthSetting(chance=0.01)).cycles == 0


def test_pictures_of_depth_and_light_are_grey_and_of_the_fine_grid(
    judge: SpadJudge, scene: SpadScene
) -> None:
    for shot in (judge.shoot(scene, PictureSetting()), judge.scan(scene, DepthSetting())):
        shown = judge.pictures(shot)
        assert {"sharp", "bicubic", "linear", "S"} <= set(shown)
        assert {picture.shape for picture in shown.values()} == {(3, *scene.light.shape)}


def test_the_command_tells_break_points_and_writes_its_page(
    bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["stress", str(bundle.path), "--quick", "--scenes", "1", "--json"]
    arguments += ["--scenarios", "photons,plate_rotation,depth_sbr", "--out-dir", str(tmp_path)]
    assert run(arguments) == 0
    photons, rotation, depth = json.loads(capsys.readouterr().out)
    # the network without a plate is that of the built-in baselines
    assert set(photons["psnr_db"]) == {"bare", "bare net", "bicubic", "linear", "S"}
    assert rotation["chi2"]["S"][0] == pytest.approx(1)
    assert set(depth["extra"]) == {"mean_error_mm", "bias_mm", "far_share", "valid_share"}
    assert "bare" in (tmp_path / "stress.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "stress.json").read_text(encoding="utf-8")) == [
        photons,
        rotation,
        depth,
    ]


def test_the_bundle_may_be_compared_with_another_of_its_camera(bundle: Bundle) -> None:
    judge = STRESS.examiner(bundle, ("S",), bundle)
    assert judge.methods == ("bare", "bare net", "bicubic", "linear", "S", "S before")
    assert judge.primary == "S"
    assert judge.identity != STRESS.examiner(bundle, ("S",), None).identity


def test_a_network_without_a_plate_is_a_rival_where_the_baselines_hold_one(
    judge: SpadJudge, scene: SpadScene
) -> None:
    beside = SpadJudge(judge.studio, replace(judge.ways, plain=judge.ways.camera))
    assert beside.rivals == ("bare", "bare net", "bicubic")
    assert set(beside.rivals) - {"bicubic"} == set(OWN["photons"].rivals)
    verdict = beside.score(beside.shoot(scene, PictureSetting()))
    assert tuple(verdict.outcomes) == beside.methods
    alone = SpadJudge(judge.studio, replace(judge.ways, plain=None))
    assert beside.identity != alone.identity


def test_without_a_network_the_linear_estimate_is_judged(
    judge: SpadJudge, scene: SpadScene
) -> None:
    alone = SpadJudge(judge.studio, replace(judge.ways, networks={}, plain=None))
    assert alone.primary == "linear"
    verdict = alone.score(alone.shoot(scene, PictureSetting()))
    assert set(verdict.outcomes) == {"bare", "bicubic", "linear"}

"""Captures with lights are scored on linear light, beside the picture of the bare lens."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.hdr_score import BEST_DB, mu_law
from camkit.report.kinds.hdr import judge as judge_module
from camkit.report.kinds.hdr.judge import (
    GOOD_DB,
    SATURATED,
    TIE_DB,
    HdrJudge,
    HdrShot,
    hdr_judge_of,
    shortfall,
)
from camkit.report.kinds.hdr.lights import dimmed, with_lamp
from camkit.report.stress.rig import Restored
from camkit.report.stress.scene import Scene, stress_scenes
from camkit.report.stress.verdict import Outcome
from camkit.runtime.twin.saturation import saturation_of
from camkit.scenes.saturation import CEILING
from tests.hdr_bundle import write_hdr_bundle

POWER = 64.0


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hdr_bundle(tmp_path_factory.mktemp("hdr"))


@pytest.fixture(scope="module")
def judge(bundle: Bundle) -> HdrJudge:
    return hdr_judge_of(bundle, (), None)


@pytest.fixture(scope="module")
def scene(bundle: Bundle) -> Scene:
    return stress_scenes(bundle, 1)[0]


@pytest.fixture(scope="module")
def lamp(scene: Scene) -> Scene:
    """One lamp in front of an even grey."""
    grey = np.full_like(scene.linear, 0.1)
    return scene.showing(with_lamp(grey, (96, 128), 5.0, POWER), "lamp")


@pytest.fixture(scope="module")
def shot(judge: HdrJudge, lamp: Scene) -> HdrShot:
    return judge.shoot(lamp)


def test_nothing_may_fall_behind_the_bare_lens_alone(judge: HdrJudge) -> None:
    assert judge.methods == ("input", "physics")
    assert (judge.rivals, judge.primary) == (("input",), "physics")
    assert judge.identity[0] == "hdr"


def test_a_lamp_is_read_from_its_streaks(judge: HdrJudge, shot: HdrShot) -> None:
    found = judge.score(shot)
    given, physics = (found.outcomes[name] for name in ("input", "physics"))
    assert given.psnr_db is not None
    assert physics.psnr_db is not None
    assert physics.psnr_db > given.psnr_db + 2
    assert physics.extra["stops_rmse"] < given.extra["stops_rmse"]
    assert (given.fault, physics.fault) == (None, None)
    assert 0 < found.seen["clipped_fraction"] < 0.02
    assert judge.score(shot) is found


def test_the_input_is_scored_by_the_errors_of_the_bare_lens(judge: HdrJudge, shot: HdrShot) -> None:
    picture = judge.pictures(shot)["input"]
    border = shot.coded.border_px
    assert picture == pytest.approx(mu_law(judge._developer.start(shot.bare).fill()), abs=1e-6)
    inside = np.s_[:, border:-border, border:-border]
    gap = (judge._developer.start(shot.bare).fill() - shot.truth)[inside].astype(float)
    expected = 10 * np.log10(CEILING**2 / np.mean(gap**2))
    assert judge.score(shot).outcomes["input"].psnr_db == pytest.approx(expected)


def test_scenes_without_light_above_white_give_way_to_a_night(
    judge: HdrJudge, scene: Scene
) -> None:
    lit = judge.lit(scene)
    found = saturation_of(lit.linear, judge.rig.sensor, 1.0)
    assert found.saturated_fraction == pytest.approx(SATURATED, rel=0.1)
    assert judge.lit(scene) is lit
    assert judge.lit(scene, 0.05).name != lit.name


def test_scenes_that_hold_lights_are_exposed_as_they_are(judge: HdrJudge, scene: Scene) -> None:
    rng = np.random.default_rng(3)
    linear = (rng.random(scene.linear.shape) ** 9).astype(np.float32) * 5
    lit = judge.lit(scene.showing(linear, "with lights"), 0.05)
    seen = linear > 1e-6
    ratio = lit.linear[seen] / linear[seen]
    assert ratio.max() == pytest.approx(ratio.min(), rel=1e-5)


def test_light_is_shared_by_captures_of_one_scene(judge: HdrJudge, lamp: Scene) -> None:
    first, again = judge.shoot(lamp), judge.shoot(lamp)
    assert again.coded.light is first.coded.light
    other = judge.shoot(lamp, lens=judge.rig.lens)
    assert other.coded.light is not first.coded.light
    np.testing.assert_array_equal(other.coded.capture.samples, first.coded.capture.samples)


def test_what_lies_around_a_scene_throws_its_light_into_both_captures(
    judge: HdrJudge, scene: Scene
) -> None:
    dark = scene.showing(np.full_like(scene.linear, 0.05), "dark")
    around = np.pad(dark.linear, ((0, 0), (32, 32), (32, 32)), mode="edge")
    plain = judge.shoot(dark, surroundings=around)
    lit = judge.shoot(dark, surroundings=with_lamp(around, (16.0, 160.0), 4.0, 256.0))
    np.testing.assert_array_equal(lit.truth, plain.truth)
    coded, bare = (
        now.samples.astype(float) - before.samples
        for now, before in ((lit.coded.capture, plain.coded.capture), (lit.bare, plain.bare))
    )
    assert coded[:24].sum() > 20 * abs(bare[:24].sum())


def test_a_common_scenario_is_judged_by_the_common_judge(judge: HdrJudge, scene: Scene) -> None:
    shot = judge.rig.shoot(scene)
    found = judge.score(shot)
    assert found.outcomes.keys() == {"input", "physics"}
    assert found.outcomes["physics"].chi2 == pytest.approx(1, abs=0.01)
    assert judge.pictures(shot)["sharp"].max() <= 1
    again = judge.judge(shot, judge.rig.restore(shot), with_chi2=False)
    assert again["physics"].psnr_db == found.outcomes["physics"].psnr_db
    assert again["physics"].chi2 is None


@pytest.mark.parametrize(
    ("psnr_db", "given_db", "words"),
    [
        (40.0, 40.0 + 1.2 * TIE_DB, "0.6 dB below the input, at 40.0 dB"),
        (40.0, 40.0 + TIE_DB, None),
        (GOOD_DB, 90.0, None),
        (50.0, 40.0, None),
        (None, 40.0, None),
        (40.0, None, None),
    ],
)
def test_a_result_below_the_input_is_a_fault_unless_it_is_good(
    psnr_db: float | None, given_db: float | None, words: str | None
) -> None:
    assert shortfall(Outcome(psnr_db=psnr_db), Outcome(psnr_db=given_db)) == words


def test_a_picture_that_is_not_finite_is_a_fault(
    bundle: Bundle, lamp: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = hdr_judge_of(bundle, (), None)
    shot = judge.shoot(lamp)
    broken = np.full_like(shot.truth, np.nan)
    restored = Restored(planes={}, pictures={"physics": broken}, faults={})
    monkeypatch.setattr(judge.rig, "restore", lambda _shot: restored)
    physics = judge.score(shot).outcomes["physics"]
    assert (physics.psnr_db, physics.fault) == (None, "NaN or inf in the picture")


def test_what_gave_nothing_says_why(
    bundle: Bundle, lamp: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = hdr_judge_of(bundle, (), None)
    restored = Restored(planes={}, pictures={}, faults={"physics": "out of memory"})
    monkeypatch.setattr(judge.rig, "restore", lambda _shot: restored)
    assert judge.score(judge.shoot(lamp)).outcomes["physics"].fault == "out of memory"


def test_a_perfect_result_is_the_best_there_is(judge: HdrJudge, shot: HdrShot) -> None:
    found = judge_module._Comparison(shot).outcome(shot.truth)
    assert found.psnr_db == BEST_DB
    assert found.extra == {"stops_rmse": 0.0, "unclipped_psnr_db": BEST_DB}


def test_where_nothing_exceeds_white_there_are_no_stops(judge: HdrJudge, scene: Scene) -> None:
    dark = scene.showing(dimmed(scene.linear), "dim")
    found = judge.score(judge.shoot(dark)).outcomes["input"]
    assert found.extra.keys() == {"unclipped_psnr_db"}

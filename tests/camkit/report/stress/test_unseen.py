"""Scenes and light as no training shows them: colours, ranges and surroundings are as stated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.colorimetry import D65
from camkit.report.stress.lamps import planckian, tint
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import choose
from camkit.report.stress.scenarios.unseen_rows import (
    MOST_RING_PX,
    ring_px,
    sunlit,
    surrounded,
)
from camkit.report.stress.scene import WHITE, Scene
from camkit.report.stress.score import Judge
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import write_hazy_bundle

COLOUR, RANGE, AROUND, BLACK, NOISE = choose(
    "light_colour,dynamic_range,surroundings,black_level,noise"
)
FLOAT32 = 2e-5


@pytest.fixture(scope="module")
def hazy(tmp_path_factory: pytest.TempPathFactory) -> Rig:
    folder = tmp_path_factory.mktemp("hazy")
    return Rig(write_hazy_bundle(folder, sensor=tiny_sensor(160, 120)), ())


def _flat(value: float, side_px: tuple[int, int] = (96, 64)) -> Scene:
    linear = np.full((3, side_px[1], side_px[0]), value, np.float32)
    return Scene(name=f"flat {value}", number=0, linear=linear)


@pytest.mark.parametrize(
    ("kelvin", "known"),
    [(2856, (0.4476, 0.4074)), (5000, (0.3451, 0.3516)), (10000, (0.2806, 0.2883))],
)
def test_black_bodies_have_the_chromaticities_that_are_tabulated(
    kelvin: float, known: tuple[float, float]
) -> None:
    """CIE 15: illuminant A, and Planck's locus."""
    np.testing.assert_allclose(planckian(kelvin), known, atol=1e-3)


def test_both_cubics_meet_and_daylight_is_near_the_white_of_rec709() -> None:
    np.testing.assert_allclose(planckian(4000), planckian(4000.001), atol=5e-4)
    np.testing.assert_allclose(planckian(6504), D65, atol=6e-3)


def test_a_warm_light_is_red_a_cold_one_blue_and_daylight_changes_nothing() -> None:
    np.testing.assert_array_equal(tint(COLOUR.nominal), 1)
    warm, cold = tint(2500), tint(10000)
    assert warm[0] == 1 > warm[1] > warm[2] > 0
    assert cold[2] == 1 > cold[1] > cold[0] > 0.5


def test_a_tinted_scene_is_tinted_in_the_truth_and_never_brighter(
    judge: Judge, scene: Scene
) -> None:
    assert COLOUR.shoot is not None
    plain, warm = (COLOUR.shoot(judge, scene, value) for value in (6500.0, 2500.0))
    assert warm.light.clean.mean() < plain.light.clean.mean()
    ratio = warm.light.clean.mean(axis=(1, 2)) / plain.light.clean.mean(axis=(1, 2))
    assert ratio[0] > 2 * ratio[2]
    assert warm.capture.white_balance == plain.capture.white_balance


@pytest.mark.parametrize("number", range(8))
def test_one_half_is_lit_as_stated_and_the_other_as_before(number: int) -> None:
    scene = replace(_flat(0.5), number=number)
    lit = sunlit(scene, 16.0)
    assert lit.max() == pytest.approx(8.0)
    assert lit.min() == 0.5
    assert (lit > 4).mean() == pytest.approx(0.5, abs=0.02)


def test_the_sun_does_not_clip_and_the_shade_is_judged_at_its_own_brightness(
    judge: Judge, scene: Scene
) -> None:
    assert RANGE.shoot is not None
    shot = RANGE.shoot(judge, scene, 64.0)
    assert not shot.capture.saturated_rows(0, shot.capture.height).any()
    assert shot.exposure == 1 / 64
    assert shot.light.clean.max() > 16 * WHITE
    found = [RANGE.take(judge, scene, v).outcomes["input"].psnr_db or 0 for v in (1.0, 64.0)]
    assert found[0] > found[1]


def test_surroundings_like_the_picture_are_its_mirror_image(hazy: Rig) -> None:
    rng = np.random.default_rng(3)
    linear = rng.uniform(0.1, 0.8, (3, 64, 96)).astype(np.float32)
    scene = Scene(name="noise", number=0, linear=linear)
    reach = ring_px(hazy.lens)
    assert reach == 24
    alone = hazy.light(scene)
    amid = hazy.light_amid(scene, surrounded(scene, reach, 1.0))
    np.testing.assert_allclose(amid.planes, alone.planes, atol=5e-3)


def test_light_from_beside_grows_with_what_lies_there(hazy: Rig) -> None:
    """Optics are linear: twice the surplus of light outside is twice the surplus inside."""
    scene, reach = _flat(0.2), ring_px(hazy.lens)
    levels = {
        factor: hazy.light_amid(scene, surrounded(scene, reach, factor)).planes
        for factor in (0.5, 1.0, 2.0, 3.0)
    }
    np.testing.assert_allclose(levels[1.0], 0.2, rtol=1e-3)
    np.testing.assert_allclose(
        levels[3.0] - levels[1.0], 2 * (levels[2.0] - levels[1.0]), atol=FLOAT32
    )
    np.testing.assert_allclose(
        2 * (levels[1.0] - levels[0.5]), levels[2.0] - levels[1.0], atol=FLOAT32
    )
    rise = (levels[2.0] - levels[1.0])[1]
    assert rise[:8].mean() > 20 * abs(rise[28:36, 40:56]).mean()
    assert rise[12].mean() > 0.005  # farther than the core reaches: haze alone


def test_bright_surroundings_never_clip_the_picture(judge: Judge, scene: Scene, hazy: Rig) -> None:
    assert AROUND.shoot is not None
    flat = _flat(0.8)
    shot = AROUND.shoot(Judge(hazy), flat, 4.0)
    assert shot.exposure < 1
    assert not shot.capture.saturated_rows(0, shot.capture.height).any()
    assert AROUND.shoot(Judge(hazy), flat, -2.0).exposure == 1
    assert AROUND.shoot(judge, scene, 0.0).exposure == 1


def test_no_ring_is_wider_than_what_is_asked_for(hazy: Rig) -> None:
    haze = hazy.lens.haze
    assert haze is not None
    assert ring_px(replace(hazy.lens, haze=replace(haze, reach_cells=100))) == MOST_RING_PX
    assert ring_px(replace(hazy.lens, haze=None, margin_px=0)) == 1


@pytest.mark.parametrize("value", [-1.0, 1.0])
def test_a_wrong_black_level_shifts_the_signal_by_its_share(
    value: float, judge: Judge, scene: Scene
) -> None:
    assert BLACK.shoot is not None
    true, wrong = (BLACK.shoot(judge, scene, v).capture for v in (0.0, value))
    np.testing.assert_array_equal(true.samples, wrong.samples)
    signal = [c.linear_rows(0, c.height).astype(np.float64) for c in (true, wrong)]
    share = value / 100
    np.testing.assert_allclose(signal[1], (signal[0] - share) / (1 - share), atol=1e-6)


def test_captures_that_differ_in_their_black_level_alone_are_judged_apart(
    judge: Judge, scene: Scene
) -> None:
    found = [BLACK.take(judge, scene, v).outcomes for v in (0.0, 1.0, -1.0)]
    for method in ("input", "M"):
        assert len({outcomes[method].psnr_db for outcomes in found}) == 3


def test_below_its_lowest_iso_a_sensor_has_the_noise_of_that(
    judge: Judge, scene: Scene, bundle: Bundle
) -> None:
    assert NOISE.values[0] == 50
    assert NOISE.shoot is not None
    shots = [NOISE.shoot(judge, scene, iso) for iso in (50.0, 100.0)]
    np.testing.assert_array_equal(shots[0].capture.samples, shots[1].capture.samples)
    assert [shot.capture.iso for shot in shots] == [50, 100]
    assert shots[0].noise == bundle.manifest.sensor.noise_at(100)  # type: ignore[union-attr]


def test_they_ask_for_no_haze(bundle: Bundle, tmp_path: Path) -> None:
    hazy_bundle = write_hazy_bundle(tmp_path)
    for scenario in (COLOUR, RANGE, AROUND, BLACK):
        assert scenario.applies(bundle) is None
        assert scenario.applies(hazy_bundle) is None

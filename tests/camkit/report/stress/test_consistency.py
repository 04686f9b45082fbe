"""chi^2 is 1 for the truth, and rises with what is missing or invented."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.stress.consistency import Scale, calibrate, judged_pixels, near, residual
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.twin.exposure import Setting


@pytest.fixture
def truth(bundle: Bundle, scene: Scene, judge: Judge):
    light = judge.rig.light(scene)
    shot = judge.rig.record(scene, light, Setting(iso=400))
    shade = illumination_band(bundle.psf, light.window, 0, light.clean.shape[1])
    return shot, light.clean * shade


@pytest.mark.parametrize("iso", [100.0, 1600.0])
def test_the_truth_explains_its_capture_at_any_noise(
    bundle: Bundle, scene: Scene, judge: Judge, iso: float
) -> None:
    # One kernel for all places: blurring by coarser blocks than the twin's is then exact.
    kernel = judge.rig.lens.kernels_at(0.3, 0.2)
    lens = replace(judge.rig.lens, kernels_at=lambda *_: kernel)
    light = judge.rig.light(scene, lens)
    shot = judge.rig.record(scene, light, Setting(iso=iso))
    shade = illumination_band(bundle.psf, light.window, 0, light.clean.shape[1])
    found = residual(light.clean * shade, shot, lens)
    assert found is not None
    assert found.chi2(0.0) == pytest.approx(1.0, abs=0.1)


def test_lost_and_invented_light_are_unexplained(truth, judge: Judge) -> None:
    shot, planes = truth
    sound = residual(planes, shot, judge.rig.lens)
    assert sound is not None
    invented = planes * (1 + 0.5 * np.sin(np.arange(planes.shape[2]) / 3))
    for wrong in (0.7 * planes, invented.astype(np.float32)):
        found = residual(wrong, shot, judge.rig.lens)
        assert found is not None
        assert found.chi2(0.0) > 2 * sound.chi2(0.0)


def test_calibrated_it_is_one_and_never_scaled_up(truth, judge: Judge) -> None:
    shot, planes = truth
    rough = residual(np.roll(planes, 1, axis=2), shot, judge.rig.lens)
    assert rough is not None
    scale = calibrate(rough)
    assert (scale.model_error > 0, scale.unit) == (True, 1.0)
    assert scale.chi2(rough) == pytest.approx(1.0, abs=1e-3)
    quiet = type(rough)(
        squared=0.5 * rough.noise_variance,
        noise_variance=rough.noise_variance,
        contrast=rough.contrast,
    )
    assert calibrate(quiet) == Scale(model_error=0.0, unit=1.0)
    assert Scale().chi2(quiet) == pytest.approx(0.5)


def test_where_contrast_cannot_explain_the_nominal_it_is_the_unit(truth, judge: Judge) -> None:
    shot, planes = truth
    nominal = residual(planes, shot, judge.rig.lens)
    assert nominal is not None
    flat = replace(nominal, squared=3 * nominal.noise_variance, contrast=0 * nominal.contrast)
    scale = calibrate(flat)
    assert scale.unit == pytest.approx(3.0)
    assert scale.chi2(flat) == pytest.approx(1.0)
    assert scale.chi2(replace(flat, squared=2 * flat.squared)) == pytest.approx(2.0)


def test_what_clipped_is_not_judged(bundle: Bundle, scene: Scene, judge: Judge) -> None:
    light = judge.rig.light(scene)
    bright = judge.rig.record(scene, light, Setting(exposure=1000.0))
    assert judged_pixels(bright).mean() < 0.1
    assert residual(light.clean, bright, judge.rig.lens) is None


def test_near_is_a_square_around_every_sample() -> None:
    mask = np.zeros((9, 9), dtype=bool)
    mask[4, 1] = True
    grown = near(mask, 2)
    assert grown[2:7, 0:4].all()
    assert grown.sum() == 20
    assert not near(np.zeros((3, 3), dtype=bool), 2).any()

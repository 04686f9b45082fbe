"""What a capture leaves unexplained: levels and detail apart."""

from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.report.analysis.unexplained import LEVEL_PX, Unexplained, unexplained
from camkit.report.stress.rig import Rig
from camkit.report.stress.scene import stress_scenes
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import Setting, signal_of
from camkit.runtime.twin.light import Light, LightOptions, light_of
from camkit.runtime.twin.truth import true_picture
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import write_hazy_bundle

INSIDE = np.s_[24:-24, 24:-24]


@pytest.fixture(name="seen", scope="module")
def seen_scene(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, Shot, FloatArray]:
    """Give a hazy camera, a capture of it, and the true picture."""
    folder: Path = tmp_path_factory.mktemp("hazy")
    bundle = write_hazy_bundle(folder, sensor=tiny_sensor(192, 160))
    rig = Rig(bundle, ())
    scene = stress_scenes(bundle, 1)[0]
    shot = rig.record(scene, rig.light_in_place(scene), Setting(iso=100))
    return rig, shot, true_picture(shot.light.clean, rig.sensor)


def _mean(seen: tuple[Rig, Shot, FloatArray], picture: FloatArray) -> tuple[float, float]:
    rig, shot, _ = seen
    found: Unexplained = unexplained(picture, shot, rig.lens)
    return float(np.nanmean(found.chi2[INSIDE])), float(np.nanmean(found.detail[INSIDE]))


def test_of_the_truth_both_are_about_one(seen: tuple[Rig, Shot, FloatArray]) -> None:
    chi2, detail = _mean(seen, seen[2])
    samples = (192 - 48) * (160 - 48)
    assert chi2 == pytest.approx(1, abs=5 * np.sqrt(2 / samples))
    own = 4 / LEVEL_PX**2  # what the mean of as many samples of a colour takes along
    assert detail == pytest.approx(1 - own, abs=5 * np.sqrt(2 / samples))


def test_the_light_of_the_truth_photographed_again_is_the_same(
    seen: tuple[Rig, Shot, FloatArray],
) -> None:
    """What lies around a scene throws light into it; where a lens distorts, it must stay too."""
    rig, shot, _ = seen
    options = LightOptions(scale=shot.scene.scale, distort=False)

    def missed(light: Light) -> float:
        clean = true_picture(light.clean, rig.sensor)
        again = light_of(np.maximum(clean, 0), rig.sensor, rig.lens, light.window, options)
        one, other = (signal_of(made, rig.sensor) for made in (light, again))
        return float(np.abs(one - other).max() / one.max())

    assert missed(shot.light) < 1e-5
    assert missed(rig.light(shot.scene)) > 0.05


def test_a_wrong_level_is_no_detail(seen: tuple[Rig, Shot, FloatArray]) -> None:
    true_chi2, true_detail = _mean(seen, seen[2])
    chi2, detail = _mean(seen, np.float32(1.1) * seen[2])
    assert chi2 > 2 * true_chi2
    assert detail - true_detail < 0.1 * (chi2 - true_chi2)


def test_bars_are_detail(seen: tuple[Rig, Shot, FloatArray]) -> None:
    bars = 1 + 0.3 * np.sin(2 * np.pi * np.arange(192) / 16)
    true_chi2, true_detail = _mean(seen, seen[2])
    chi2, detail = _mean(seen, (bars * seen[2]).astype(np.float32))
    assert detail - true_detail > 0.9 * (chi2 - true_chi2) > 0

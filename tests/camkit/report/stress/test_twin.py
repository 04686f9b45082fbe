"""The twin under stress is the twin of `camkit simulate`, until a knob is turned."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.twin import (
    NOISE_SEED,
    Setting,
    crop_light,
    photograph,
    transform_kernels,
    with_axis_moved,
    with_kernels,
)
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.psf_factory import coma_kernels, gaussian_kernel


def test_undisturbed_it_records_the_same_capture_as_simulate(
    bundle: Bundle, judge: Judge, scene: Scene
) -> None:
    shot = photograph(judge.rig.light(scene), bundle.manifest.camera, Setting(iso=200))
    options = SimulationOptions(
        iso=200, seed=NOISE_SEED + scene.number, origin_px=scene.origin_px((320, 240))
    )
    expected = simulate(scene.linear, bundle.manifest.camera, bundle.psf, options)
    np.testing.assert_array_equal(shot.light.clean, expected.clean)
    assert np.abs(shot.capture.samples.astype(int) - expected.mosaic).max() <= 1
    assert (shot.capture.samples == expected.mosaic).mean() > 0.999


def test_hidden_noise_has_the_factor_it_claims(bundle: Bundle, scene: Scene, judge: Judge) -> None:
    flat = replace(judge.rig.light(scene), planes=np.full((3, 240, 320), 0.5, np.float32))
    spreads = []
    for factor in (1.0, 3.0):
        setting = Setting(iso=100, noise_factor=factor)
        shot = photograph(flat, bundle.manifest.camera, setting)
        greens = shot.capture.linear_rows(0, 240)[::2, 1::2].astype(np.float64)
        assert greens.mean() == pytest.approx(0.5, rel=0.01)
        spreads.append(greens.std())
        assert shot.capture.iso == 100
    assert spreads[1] / spreads[0] == pytest.approx(3.0, rel=0.05)


def test_fewer_bits_keep_the_signal_and_coarsen_it(
    bundle: Bundle, scene: Scene, judge: Judge
) -> None:
    light, camera = judge.rig.light(scene), bundle.manifest.camera
    fine, coarse = (photograph(light, camera, Setting(bits=b)).capture for b in (14, 6))
    signal = [c.linear_rows(0, 240).astype(np.float64) for c in (fine, coarse)]
    assert coarse.white_level == 63
    assert np.abs(signal[0] - signal[1]).max() <= 0.55 / (63 - coarse.black_level[0, 0]) + 0.01
    assert np.unique(coarse.samples).size <= 64


def test_turned_by_a_right_angle_and_back_kernels_are_what_they_were() -> None:
    kernel = coma_kernels(2)[0][1]
    turned = transform_kernels(kernel, 1.0, np.pi / 2)
    np.testing.assert_allclose(turned, np.rot90(kernel, -1, axes=(1, 2)), atol=1e-6)
    np.testing.assert_allclose(transform_kernels(kernel, 1.0, 0.0), kernel, atol=1e-7)


@pytest.mark.parametrize("scale", [0.8, 1.25])
def test_scaled_kernels_have_the_scaled_width(scale: float) -> None:
    kernel = gaussian_kernel(2.5, radius_px=15)
    scaled = transform_kernels(kernel, scale, 0.0)[0]
    x = np.arange(-15, 16)
    variance = (scaled.sum(axis=0) * x**2).sum() / scaled.sum()
    assert np.sqrt(variance) == pytest.approx(2.5 * scale, rel=0.01)


def test_changed_kernels_keep_all_light(judge: Judge) -> None:
    lens = with_kernels(judge.rig.lens, lambda k: transform_kernels(k, 1.3, 0.5) - 0.001)
    kernels = lens.kernels_at(0.3, 0.2)
    np.testing.assert_allclose(kernels.sum(axis=(1, 2)), 1, rtol=1e-5)
    assert kernels.min() >= 0


def test_a_moved_axis_takes_its_kernels_along(judge: Judge) -> None:
    lens = judge.rig.lens
    moved = with_axis_moved(lens, 0.1, -0.05)
    np.testing.assert_array_equal(
        moved.kernels_at(0.3, 0.1), lens.kernels_at(0.2, 0.15000000000000002)
    )


def test_a_crop_of_the_light_stays_where_it_is(judge: Judge, scene: Scene) -> None:
    light = judge.rig.light(scene)
    small = crop_light(light, (17, 9))
    np.testing.assert_array_equal(small.planes, light.planes[:, :9, :17])
    assert small.window.origin_px == light.window.origin_px
    assert small.window.size_px == (17, 9)

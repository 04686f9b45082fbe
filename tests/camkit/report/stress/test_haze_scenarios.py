"""Cameras behind a haze: its light, size and black are as stated, and chi^2 knows of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.report.stress.consistency import residual
from camkit.report.stress.kernel_change import with_transformed
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import all_scenarios, choose
from camkit.report.stress.scenarios.lens_rows import black_taken_off, with_split
from camkit.report.stress.scene import Scene, stress_scenes
from camkit.report.stress.score import Judge
from camkit.report.stress.stress_run import StressOptions, run_stress
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.haze_spread import HazeLens
from tests.bundle_factory import tiny_sensor
from tests.deep_bundle import deep_psf
from tests.haze_bundle import hazy_manifest, hazy_optics, write_hazy_bundle
from tests.haze_factory import tiny_haze

SPLIT, DARK, SCALE = choose("energy_split,lost_dark_frame,psf_scale")
PLACE = (0.2, 0.1)


@pytest.fixture(scope="module")
def hazy(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    folder = tmp_path_factory.mktemp("hazy")
    return write_hazy_bundle(folder, sensor=tiny_sensor(320, 240))


@pytest.fixture(scope="module")
def judge(hazy: Bundle) -> Judge:
    return Judge(Rig(hazy, ()))


@pytest.fixture(scope="module")
def scene(hazy: Bundle) -> Scene:
    return stress_scenes(hazy, 1)[0]


def _haze(judge: Judge) -> HazeLens:
    assert judge.rig.lens.haze is not None
    return judge.rig.lens.haze


def _light(haze: HazeLens) -> FloatArray:
    return haze.haze_at(*PLACE).sum(axis=(1, 2))


@pytest.mark.parametrize("moved", [0.2, -0.05])
def test_what_the_peaks_lose_the_haze_gains(moved: float, judge: Judge) -> None:
    haze = _haze(judge)
    split = with_split(haze, moved)
    share = haze.share_at(*PLACE)
    np.testing.assert_allclose(split.share_at(*PLACE), (1 - moved) * share, rtol=1e-6)
    np.testing.assert_allclose(_light(split), _light(haze) + moved * share, rtol=1e-5)
    factor = (1 + moved * share / _light(haze))[:, None, None]
    np.testing.assert_allclose(split.haze_at(*PLACE), factor * haze.haze_at(*PLACE), rtol=1e-5)


def test_a_haze_gives_no_more_than_it_has(judge: Judge) -> None:
    assert (_light(with_split(_haze(judge), -100.0)) == 0).all()


def test_a_pedestal_is_taken_off_every_cell_and_none_falls_below_dark(judge: Judge) -> None:
    haze = _haze(judge)
    kernels, light = haze.haze_at(*PLACE), _light(haze) + haze.share_at(*PLACE)
    least = float((kernels.min(axis=(1, 2)) * kernels[0].size / light).min())
    small = black_taken_off(haze, 0.9 * least).haze_at(*PLACE)
    np.testing.assert_allclose(
        small.sum(axis=(1, 2)), _light(haze) - 0.9 * least * light, rtol=1e-4
    )
    np.testing.assert_allclose(
        (kernels - small)[0], 0.9 * least * light[0] / kernels[0].size, rtol=1e-2
    )
    large = black_taken_off(haze, 0.6).haze_at(*PLACE)
    assert large.min() == 0
    assert (large.sum(axis=(1, 2)) < small.sum(axis=(1, 2))).all()
    np.testing.assert_array_equal(
        black_taken_off(haze, 0.6).share_at(*PLACE), haze.share_at(*PLACE)
    )


def test_a_larger_psf_has_a_wider_haze_of_the_same_light(judge: Judge) -> None:
    lens = judge.rig.lens
    large = with_transformed(lens, 1.2, 0.0)
    assert large.haze is not None
    np.testing.assert_allclose(_light(large.haze), _light(_haze(judge)), rtol=1e-5)
    spread = [_spread(h.haze_at(*PLACE)[1]) for h in (_haze(judge), large.haze)]
    assert spread[1] > 1.05 * spread[0]
    np.testing.assert_allclose(large.kernels_at(*PLACE).sum(axis=(1, 2)), 1, rtol=1e-5)


def _spread(kernel: FloatArray) -> float:
    y, x = np.indices(kernel.shape) - kernel.shape[0] // 2
    return float((kernel * (x**2 + y**2)).sum() / kernel.sum())


def test_the_spectrum_of_the_light_weighs_peaks_and_haze(judge: Judge, hazy: Bundle) -> None:
    wavelengths_um, response = judge.rig.sensor.response_arrays()
    same = judge.rig.lens_under((wavelengths_um, response))
    red = judge.rig.lens_under((wavelengths_um, response * np.array([0.0, 0.1, 1.0])))
    assert same.haze is not None
    assert red.haze is not None
    np.testing.assert_array_equal(same.haze.share_at(*PLACE), _haze(judge).share_at(*PLACE))
    expected = hazy_kernels(
        hazy.psf, hazy.haze, wavelengths_um, response * np.array([0.0, 0.1, 1.0])
    )
    np.testing.assert_array_equal(red.haze.share_at(*PLACE), expected.coarse_core.light_at(*PLACE))
    assert (red.haze.share_at(*PLACE) < _haze(judge).share_at(*PLACE)).any()


def test_the_truth_explains_its_hazy_capture_and_without_the_haze_it_does_not(
    judge: Judge, hazy: Bundle, scene: Scene
) -> None:
    # One kernel for all places: blurring by coarser blocks than the twin's is then exact.
    lens, haze = judge.rig.lens, _haze(judge)
    kernel, cells, share = lens.kernels_at(*PLACE), haze.haze_at(*PLACE), haze.share_at(*PLACE)
    even = replace(
        lens,
        kernels_at=lambda *_: kernel,
        haze=replace(haze, haze_at=lambda *_: cells, share_at=lambda *_: share),
    )
    light = judge.rig.light(scene, even)
    shot = judge.rig.record(scene, light, Setting(iso=1600))
    shade = illumination_band(hazy.psf, light.window, 0, light.clean.shape[1])
    found, blind = (
        residual(light.clean * shade, shot, chosen) for chosen in (even, replace(even, haze=None))
    )
    assert found is not None
    assert blind is not None
    assert found.chi2(0.0) == pytest.approx(1.0, abs=0.15)
    assert blind.chi2(0.0) > 2 * found.chi2(0.0)


@pytest.mark.parametrize("scenario", [SPLIT, DARK], ids=lambda s: s.name)
def test_every_method_gets_worse_where_its_haze_is_wrong(
    scenario, judge: Judge, scene: Scene
) -> None:
    found = [scenario.take(judge, scene, v).outcomes for v in (scenario.nominal, 60.0)]
    for method in ("haze", "wiener"):
        good, bad = (outcomes[method] for outcomes in found)
        assert (bad.psnr_db or 0) < (good.psnr_db or 0)
        assert good.chi2 == pytest.approx(1, abs=0.05)


def test_a_sweep_says_where_they_break(hazy: Bundle) -> None:
    options = StressOptions(scenarios=(SPLIT, DARK), scenes=1, quick=True)
    result = run_stress(hazy, options)
    assert [row["scenario"] for row in result.rows] == ["energy_split", "lost_dark_frame"]
    for row in result.rows:
        assert row["skipped"] is None
        assert {found["side"] for found in row["breaks"]} >= {"up"}


def test_without_a_haze_they_are_left_out_with_a_word(bundle: Bundle, hazy: Bundle) -> None:
    for scenario in (SPLIT, DARK):
        assert "no haze" in (scenario.applies(bundle) or "")
        assert scenario.applies(hazy) is None
    assert SCALE.applies(bundle) is None


def test_peaks_take_no_more_than_the_least_haze_holds(tmp_path: Path, hazy: Bundle) -> None:
    assert SPLIT.for_bundle(hazy).values == SPLIT.values
    thin = tiny_haze()
    thin = replace(thin, kernels=thin.kernels * np.float32(0.2))
    path = tmp_path / "thin.camkit"
    optics = replace(hazy_optics(), haze=thin)
    write_bundle(path, hazy_manifest(sensor=tiny_sensor(320, 240)), optics.members)
    values = SPLIT.for_bundle(open_bundle(path)).values
    share = thin.kernels.sum(axis=(-2, -1)) / thin.core_share
    assert values[0] >= -100 * share.min() > -40
    assert values == SPLIT.values[-len(values) :]


def test_sizes_go_farther_behind_a_haze(bundle: Bundle, hazy: Bundle) -> None:
    assert SCALE.for_bundle(bundle).values == SCALE.values
    far = SCALE.for_bundle(hazy).values
    assert far == (-40.0, -30.0, *SCALE.values, 30.0, 40.0)


def test_a_stress_psf_says_nothing_of_a_haze(hazy: Bundle, monkeypatch: pytest.MonkeyPatch) -> None:
    (defocus,) = choose("defocus")
    monkeypatch.setattr(type(hazy), "stress_psf", lambda self: self.psf)
    assert "nothing of its haze" in (defocus.applies(hazy) or "")


def test_nearer_objects_are_worse_behind_a_haze(tmp_path: Path, scene: Scene) -> None:
    widening = deep_psf((1000.0, 2000.0, 4000.0))
    sharp_far = replace(
        widening,
        kernels=widening.kernels[:, ::-1].copy(),
        depths_mm=np.array([500.0, 1000.0, np.inf]),
    )
    wide = tiny_haze(sharp_far)
    # an object far away has most light in its core
    share = wide.core_share * np.array([0.5, 0.8, 1.0])[:, None]
    members = hazy_optics().members | {
        "stress_psf.safetensors": psf_to_bytes(sharp_far),
        "stress_haze.safetensors": haze_to_bytes(replace(wide, core_share=share)),
    }
    path = tmp_path / "near.camkit"
    write_bundle(path, hazy_manifest(sensor=tiny_sensor(320, 240)), members)
    near = open_bundle(path)
    (defocus,) = choose("defocus")
    assert defocus.applies(near) is None
    fitted = defocus.for_bundle(near)
    assert fitted.values == (0.0, 1.0, 2.0)
    judge = Judge(Rig(near, ()))
    found = [fitted.take(judge, scene, value).outcomes for value in fitted.values]
    for method in ("input", "haze"):  # the bank is that of another kernel
        far, middle, close = (of[method].psnr_db or 0 for of in found)
        assert far > middle > close, method


def test_every_other_scenario_of_the_lens_is_survived(judge: Judge, scene: Scene) -> None:
    for scenario in all_scenarios():
        if scenario.applies(judge.rig.bundle) is None and scenario.name in {
            "illuminant",
            "psf_rotation",
            "decentre",
            "wrong_bundle",
        }:
            value = [v for v in scenario.quick if v != scenario.nominal][-1]
            outcomes = scenario.take(judge, scene, value).outcomes
            assert all(o.psnr_db is not None and o.fault is None for o in outcomes.values())

"""What the rig restores is what the pipeline restores, and it photographs as `simulate` does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.colorimetry import encode_srgb
from camkit.errors import ContractError
from camkit.report.stress.rig import INPUT, Rig, restored_plane
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, judge_of
from camkit.report.stress.shot import NOISE_SEED
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.exposure import Setting
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.glare_bundle import write_glare_bundle


@pytest.mark.parametrize(
    ("method", "name"), [("develop", INPUT), ("wiener", "wiener"), ("net", "M")]
)
@pytest.mark.parametrize("exposure", [1.0, 4.0])
def test_the_rig_gives_the_bits_of_the_pipeline(
    bundle: Bundle, judge: Judge, scene: Scene, method: str, name: str, exposure: float
) -> None:
    shot = judge.rig.shoot(scene, setting=Setting(iso=200, exposure=exposure))
    restored = judge.rig.restore(shot)
    pipeline = Pipeline(bundle, Options(method=method, undistort=False, threads=1))
    np.testing.assert_array_equal(
        restored.pictures[name], pipeline.start(shot.capture).fill(), strict=True
    )
    light = pipeline.start(shot.capture).rows_of("clean")
    np.testing.assert_array_equal(restored.planes[name], light.read(0, light.shape[1]))


def test_methods_are_those_of_the_bundle_and_the_simple_ones_are_rivals(
    judge: Judge, bundle: Bundle
) -> None:
    assert judge.methods == (INPUT, "wiener", "M")
    assert (judge.rivals, judge.primary) == ((INPUT, "wiener"), "M")
    assert restored_plane(bundle.manifest) == "clean"


def test_what_methods_share_is_computed_once(
    judge: Judge, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[str] = []
    keep = Reconstruction.keep

    def counted(work: Reconstruction, plane: str) -> object:
        before = work.seconds.get("wiener", 0.0)
        made = keep(work, plane)
        if work.seconds.get("wiener", 0.0) > before:
            kept.append(plane)
        return made

    monkeypatch.setattr(Reconstruction, "keep", counted)
    judge.rig.restore(judge.rig.shoot(scene, setting=Setting(iso=300)))
    assert kept == ["restored"]


def test_its_pictures_are_finished_at_the_brightness_of_the_scene(
    judge: Judge, bundle: Bundle, scene: Scene
) -> None:
    shot = judge.rig.shoot(scene, setting=Setting(exposure=0.5))
    pipeline = Pipeline(bundle, Options(undistort=False, threads=1))
    expected = encode_srgb(pipeline.start(shot.capture).fill() / np.float32(0.5))
    pictures = judge.pictures(shot)
    np.testing.assert_array_equal(pictures["M"], expected)
    assert set(pictures) == {"sharp", *judge.methods}


def test_undisturbed_it_records_the_same_capture_as_simulate(
    bundle: Bundle, judge: Judge, scene: Scene
) -> None:
    shot = judge.rig.shoot(scene, setting=Setting(iso=200))
    options = SimulationOptions(
        iso=200, seed=NOISE_SEED + scene.number, origin_px=scene.origin_px((320, 240))
    )
    expected = simulate(scene.linear, bundle.manifest.sensor, bundle.psf, options)
    np.testing.assert_array_equal(shot.light.clean, expected.clean)
    np.testing.assert_array_equal(shot.capture.samples, expected.samples)
    assert (shot.capture.iso, shot.capture.white_balance) == (200, expected.white_balance)


def test_fewer_bits_keep_the_signal_and_coarsen_it(judge: Judge, scene: Scene) -> None:
    fine, coarse = (judge.rig.shoot(scene, setting=Setting(bits=b)).capture for b in (14, 6))
    signal = [c.linear_rows(0, 240).astype(np.float64) for c in (fine, coarse)]
    assert coarse.white_level == 63
    assert np.abs(signal[0] - signal[1]).max() <= 0.55 / (63 - coarse.black_level[0, 0]) + 0.01
    assert np.unique(coarse.samples).size <= 64


def test_other_options_make_another_rig_which_is_kept(judge: Judge, scene: Scene) -> None:
    shot = judge.rig.shoot(scene)
    tiled = judge.rig.choosing(tile_px=48)
    assert tiled is judge.rig.choosing(tile_px=48)
    assert tiled.methods[-1].pipeline.options.tile_px == 48
    whole, parts = judge.rig.restore(shot).pictures["M"], tiled.restore(shot).pictures["M"]
    np.testing.assert_array_equal(parts, whole)


def test_a_network_that_explodes_is_a_fault_and_not_a_picture(bundle: Bundle, scene: Scene) -> None:
    rig = Rig(bundle, ("M",))
    (network,) = rig.networks
    engine = network.pipeline.network("restore", "M")
    run = engine.run
    engine.run = lambda window, **_: 1e6 * run(window)  # type: ignore[method-assign]
    outcome = Judge(rig).score(rig.shoot(scene)).outcomes["M"]
    assert outcome.psnr_db is None
    assert "tile (row 0, column 0)" in (outcome.fault or "")


def test_a_bundle_without_optics_is_no_camera_and_not_stressed(tmp_path: Path) -> None:
    with pytest.raises(
        ContractError, match=r"deglare states no optics, .* judges cameras by their optics"
    ):
        judge_of(open_bundle(write_glare_bundle(tmp_path)), (), None)


def test_a_size_that_the_bundle_lacks_is_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="holds size"):
        Rig(bundle, ("L",))


def test_networks_of_another_bundle_restore_by_their_own_pipeline(
    bundle: Bundle, scene: Scene
) -> None:
    rig = Rig(bundle, ("M",), earlier_bundle=replace(bundle))
    assert [m.name for m in rig.methods] == [INPUT, "wiener", "M", "M before"]
    pictures = rig.restore(rig.shoot(scene)).pictures
    np.testing.assert_array_equal(pictures["M"], pictures["M before"])

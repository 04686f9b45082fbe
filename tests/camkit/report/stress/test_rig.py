"""What the rig restores is what the pipeline restores."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.stress.rig import Rig
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Comparison, Judge
from camkit.report.stress.twin import Setting, photograph
from camkit.runtime.color import recover_highlights
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline


@pytest.mark.parametrize(("method", "name"), [("wiener", "wiener"), ("net", "M")])
@pytest.mark.parametrize("exposure", [1.0, 4.0])
def test_the_rig_gives_the_bits_of_the_pipeline(
    bundle: Bundle, judge: Judge, scene: Scene, method: str, name: str, exposure: float
) -> None:
    setting = Setting(iso=200, exposure=exposure)
    shot = photograph(judge.rig.light(scene), bundle.manifest.camera, setting)
    options = Options(
        method=method,  # type: ignore[arg-type]
        undistort=False,
        vignetting=False,
        color="camera",
        threads=1,
    )
    expected = Pipeline(bundle, options).start(shot.capture).fill(None)
    planes = judge.rig.restore(shot).planes[name]
    np.testing.assert_array_equal(recover_highlights(planes, shot.light.gains), expected)


def test_finished_it_has_the_colours_of_the_pipeline(
    bundle: Bundle, judge: Judge, scene: Scene
) -> None:
    from camkit.colorimetry import encode_srgb

    shot = photograph(judge.rig.light(scene), bundle.manifest.camera, Setting())
    pipeline = Pipeline(bundle, Options(undistort=False, threads=1))
    expected = encode_srgb(pipeline.start(shot.capture).fill(None))
    got = Comparison(shot, judge.rig).finish(judge.rig.restore(shot).planes["M"])
    np.testing.assert_allclose(got, expected, atol=2e-6)


def test_a_network_that_explodes_is_a_fault_and_not_a_picture(
    bundle: Bundle, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(bundle, ("M",))
    run = rig.networks[0].engine.run
    monkeypatch.setattr(rig.networks[0].engine, "run", lambda window: 1e6 * run(window))
    shot = photograph(rig.light(scene), bundle.manifest.camera, Setting())
    outcome = Judge(rig).judge(shot, rig.restore(shot))["M"]
    assert outcome.psnr_db is None
    assert "tile (row 0, column 0)" in (outcome.fault or "")


def test_a_size_that_the_bundle_lacks_is_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="holds size"):
        Rig(bundle, ("L",))

"""The depth scenario takes the depths of the bundle, and photographs through their kernels."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import choose
from camkit.report.stress.scenarios.lens_rows import FAR_M
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from tests.deep_bundle import write_deep_bundle

(DEPTH,) = choose("depth")
(KNOWN,) = choose("known_depth")


@pytest.fixture(scope="module")
def deep(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_deep_bundle(tmp_path_factory.mktemp("deep"))


def test_values_are_the_depths_and_the_focus_is_nominal(deep: Bundle, tmp_path: Path) -> None:
    fitted = DEPTH.for_bundle(deep)
    assert (fitted.values, fitted.nominal) == ((0.5, 1.0, 2.0), 1.0)
    endless = write_deep_bundle(tmp_path, depths_mm=(700.0, 2000.0, np.inf))
    fitted = DEPTH.for_bundle(endless)
    assert (fitted.values, fitted.nominal) == ((0.7, 2.0, FAR_M), 0.7)
    assert fitted.quick == (0.7, FAR_M)


def test_bundles_of_one_depth_take_no_part(bundle: Bundle, deep: Bundle) -> None:
    assert "no several depths" in (DEPTH.applies(bundle) or "")
    assert DEPTH.applies(deep) is None


def test_the_input_is_best_at_the_focus_and_chi2_goes_by_the_kernels_of_the_bank(
    deep: Bundle, scene: Scene
) -> None:
    judge = Judge(Rig(deep, ("M",)))
    fitted = DEPTH.for_bundle(deep)
    found = {v: fitted.take(judge, scene, v).outcomes for v in fitted.values}
    inputs = [found[v]["input"].psnr_db or 0 for v in fitted.values]
    assert inputs[1] > max(inputs[0], inputs[2]) + 0.5
    assert found[1.0]["wiener"].chi2 == pytest.approx(1, abs=0.05)
    mean, focused = (
        k(0.1, 0.2) for k in (judge.rig.assumed_lens.kernels_at, judge.rig.lens.kernels_at)
    )
    expected = deep.psf.kernels.mean(axis=1)[0, 0]
    np.testing.assert_allclose(mean[1], expected, atol=0.01)
    assert focused.max() > 1.5 * mean.max()


def test_a_bank_that_is_told_the_depth_has_its_kernel_and_the_rig_forgets_it(
    deep: Bundle, bundle: Bundle, scene: Scene
) -> None:
    assert "no several depths" in (KNOWN.applies(bundle) or "")
    judge = Judge(Rig(deep, ("M",)))
    blind, known = DEPTH.for_bundle(deep), KNOWN.for_bundle(deep)
    assert (known.values, known.nominal) == (blind.values, blind.nominal)
    for value in known.values:
        told, untold = (s.take(judge, scene, value).outcomes for s in (known, blind))
        assert told["input"].psnr_db == untold["input"].psnr_db
        assert told["wiener"].psnr_db != untold["wiener"].psnr_db
        assert told["M"].chi2 is None
        if value == known.nominal:  # sharp there: the mean kernel takes a blur away that is none
            assert (told["wiener"].psnr_db or 0) > (untold["wiener"].psnr_db or 0) + 1
    again = blind.take(judge, scene, 0.5).outcomes["wiener"].psnr_db
    assert again == blind.take(Judge(Rig(deep, ("M",))), scene, 0.5).outcomes["wiener"].psnr_db

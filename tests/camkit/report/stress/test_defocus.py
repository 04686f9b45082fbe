"""The defocus scenario goes nearer and farther than the focus, by the bundle's stress PSF."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.stress.rig import Rig
from camkit.report.stress.scenario import choose
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from tests.deep_bundle import write_deep_bundle

(DEFOCUS,) = choose("defocus")


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    folder = tmp_path_factory.mktemp("near")
    return write_deep_bundle(
        folder, depths_mm=(1000.0,), stress_mm=(600.0, 800.0, 1000.0, 1250.0, np.inf)
    )


def test_values_are_the_distances_of_the_stress_psf(near: Bundle) -> None:
    assert DEFOCUS.applies(near) is None
    fitted = DEFOCUS.for_bundle(near)
    assert fitted.values == (0.0, 0.8, 1.0, 1.25, 1.666667)
    assert (fitted.nominal, fitted.quick) == (1.0, (0.0, 1.0, 1.666667))


def test_a_bundle_without_its_focus_takes_no_part(bundle: Bundle, tmp_path: Path) -> None:
    far = write_deep_bundle(tmp_path, depths_mm=(1000.0,), stress_mm=(5000.0, np.inf))
    assert "does not hold its focus" in (DEFOCUS.applies(far) or "")
    alone = write_deep_bundle(tmp_path, "one.camkit", depths_mm=(1000.0,), stress_mm=(1000.0,))
    assert "something beside it" in (DEFOCUS.applies(alone) or "")
    none = write_deep_bundle(tmp_path, "none.camkit")
    assert "holds no stress_psf" in (DEFOCUS.applies(none) or "")


def test_captures_are_worse_on_both_sides_of_the_focus(near: Bundle, scene: Scene) -> None:
    judge = Judge(Rig(near, ("M",)))
    fitted = DEFOCUS.for_bundle(near)
    found = {v: fitted.take(judge, scene, v).outcomes for v in fitted.values}
    inputs = [found[v]["input"].psnr_db or 0 for v in fitted.values]
    assert inputs[2] == max(inputs)
    assert inputs[0] < inputs[1] < inputs[2] > inputs[3] > inputs[4]

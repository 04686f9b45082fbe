"""tools/lens/cameras.py: what is exposed, and that more light is never worse."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.report.analysis.recovery import filled
from camkit.report.quality import read_picture
from tools.lens import cameras


@pytest.mark.parametrize(
    ("exposure", "iso", "share"),
    [(1.0, 100, 1.0), (0.25, 400, 1.0), (1 / 64, 6400, 1.0), (1 / 256, 6400, 0.25), (9, 100, 1)],
)
def test_the_iso_is_what_the_exposure_needs_and_no_more_than_the_camera_has(
    exposure: float, iso: float, share: float
) -> None:
    setting = cameras.setting_of(exposure)
    assert setting.iso == pytest.approx(iso)
    assert setting.exposure == pytest.approx(share)


def test_less_light_is_noisier_and_as_bright(
    hazy: str, picture: Callable[[str], Path], tmp_path: Path
) -> None:
    bundle = cameras.open_camera(hazy, tmp_path / "camera")
    assert cameras.ways_of(bundle) == ("filter",)
    light = cameras.light_through(bundle, filled(read_picture(picture("a")), 128, 96))
    truth = cameras.truth_of(bundle, light)
    db = {}
    for exposure in (1.0, 1 / 16, 1 / 1024):
        shown = cameras.restored(bundle, light, exposure, "filter")
        assert shown.mean() == pytest.approx(truth.mean(), rel=0.1)
        db[exposure] = cameras.decibels(cameras.square_error(shown, truth))
    assert db[1.0] > db[1 / 16] + 0.2
    assert db[1 / 16] > db[1 / 1024] + 3
    developed = cameras.restored(bundle, light, 1.0, "develop")
    assert cameras.decibels(cameras.square_error(developed, truth)) < db[1.0] - 2


def test_light_may_come_through_other_optics(
    hazy: str, clear: str, picture: Callable[[str], Path], tmp_path: Path
) -> None:
    bundle = cameras.open_camera(hazy, tmp_path / "one")
    other = cameras.open_camera(clear, tmp_path / "other")
    scene = filled(read_picture(picture("a")), 128, 96)
    lent = cameras.light_through(bundle, scene, optics=cameras.optics_of(other))
    assert np.array_equal(lent.planes, cameras.light_through(other, scene).planes)
    assert not np.allclose(lent.planes, cameras.light_through(bundle, scene).planes, atol=1e-3)


def test_light_through_a_stop_goes_with_its_area() -> None:
    lens = read_lens(Path("thin-plate-stop"))
    half = replace(lens, aperture_value=lens.aperture_value / 2)
    ratio = cameras.passed_light(half) / cameras.passed_light(lens)
    assert ratio == pytest.approx(0.25, rel=0.01)


def test_a_name_that_nothing_has_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="nothing is called"):
        cameras.open_camera("nothing", tmp_path)

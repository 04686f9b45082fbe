from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.quality import FABRICATION_SEEDS, Shot, judge
from camkit.runtime.geometry.illumination import illumination_band
from tests.deep_bundle import write_deep_bundle
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.photograph import TUNING_SEED, bundle_restorer, finish_planes, photograph

SHOT = Shot(set_name="set", picture=Path("a.png"), number=0, position=2, iso=100.0, psf="bundle")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def test_tuning_has_a_lens_copy_of_its_own() -> None:
    assert TUNING_SEED not in FABRICATION_SEEDS


def test_the_clean_picture_in_sensor_geometry_is_the_truth(bundle: Bundle) -> None:
    scene = decode_srgb(texture(150, 170))
    taken = photograph(SHOT, scene, bundle, bundle.frozen_optics)
    planes = taken.simulation.clean
    shaded = planes * illumination_band(bundle.psf, taken.simulation.window, 0, 150)
    assert judge(finish_planes(shaded, taken, bundle), taken.sharp).psnr_db > 80


def test_developing_only_matches_the_brightness_of_the_sharp_picture(bundle: Bundle) -> None:
    scene = np.full((3, 120, 160), 0.3, np.float32)
    taken = photograph(replace(SHOT, position=4), scene, bundle, bundle.frozen_optics)
    developed = finish_planes(taken.local.planes, taken, bundle)
    np.testing.assert_allclose(developed.mean(axis=(1, 2)), 0.3, rtol=0.01)


def test_the_wiener_bank_beats_the_capture_through_its_own_lens(bundle: Bundle) -> None:
    scene = decode_srgb(texture(150, 170))
    taken = photograph(SHOT, scene, bundle, bundle.frozen_optics)
    developed = judge(finish_planes(taken.local.planes, taken, bundle), taken.sharp)
    restored = judge(bundle_restorer(bundle, method="wiener")(taken), taken.sharp)
    assert restored.psnr_db > developed.psnr_db + 0.5


def test_a_network_answers_in_sensor_geometry(bundle: Bundle) -> None:
    taken = photograph(SHOT, decode_srgb(texture(100, 140)), bundle, bundle.frozen_optics)
    assert bundle_restorer(bundle, size="M")(taken).shape == (3, 100, 140)


def test_a_size_that_the_bundle_lacks_is_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="holds size"):
        bundle_restorer(bundle, size="L")


def test_a_camera_of_several_depths_is_judged_at_its_focus(tmp_path: Path) -> None:
    deep = write_deep_bundle(tmp_path)
    scene = decode_srgb(texture(150, 170))
    taken = photograph(SHOT, scene, deep, deep.frozen_optics)
    assert taken.simulation.depth_mm == 1000.0
    expected = deep.psf.kernels.mean(axis=1)[0, 0]
    np.testing.assert_allclose(taken.local.psf.kernels.kernels[0, 1], expected, atol=1e-6)
    assert judge(bundle_restorer(deep, method="wiener")(taken), taken.sharp).psnr_db > 15

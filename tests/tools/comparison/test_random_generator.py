"""A camera with a random generator is timed like any other, and says that it is not trained."""

import numpy as np
import pytest

from camkit.bundle.manifest import NOT_TRAINED
from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.models_def.networks.normed_unet import NormedConfig
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor
from tests.plain_bundle import write_bankless_bundle
from tools.comparison import random_generator

WIDTH = 4
SIDES_PX = (400, 100)


@pytest.fixture(scope="module")
def camera(tmp_path_factory):
    folder = tmp_path_factory.mktemp("generator")
    path, out = folder / "camera.camkit", folder / "generator.camkit"
    write_bundle(path, tiny_manifest(sensor=tiny_sensor(*SIDES_PX)), tiny_members())
    random_generator.main([str(path), "--width", str(WIDTH), "-o", str(out)])
    return open_bundle(out)


def test_the_bundle_says_what_it_holds(camera):
    assert camera.manifest.training_data == NOT_TRAINED
    assert not camera.manifest.is_trained
    (facts,) = camera.manifest.networks["restore"].values()
    assert (facts.reach_px, facts.stride_px) == (128, 64)
    assert camera.manifest.golden == ()


def _start(camera, **options):
    pipeline = Pipeline(camera, Options(threads=1, **options))
    capture = np.random.default_rng(3).integers(300, 3000, SIDES_PX[::-1], dtype=np.uint16)
    shot = pipeline.capture_of(capture, iso=100.0, white_balance=None, origin_px=None)
    return pipeline.start(shot)


def test_a_picture_in_tiles_has_the_bits_of_the_whole(camera):
    whole = _start(camera, mode="whole").fill()
    assert np.isfinite(whole).all()
    for tile_px, windows in ((64, 3), (128, 2)):
        work = _start(camera, tile_px=tile_px)
        assert work.record["tiles"]["windows"] == windows
        assert np.array_equal(work.fill(), whole)


def test_a_camera_of_other_planes_is_refused(tmp_path):
    bundle = write_bankless_bundle(tmp_path)
    with pytest.raises(ContractError, match="no network of 6 planes"):
        random_generator.with_generator(bundle, NormedConfig(width=WIDTH), tmp_path / "x.camkit")

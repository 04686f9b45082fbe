"""The truth beside a capture is the picture that the camera would give if nothing were lost."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.facts import Port
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import Extent, SpadSensor
from camkit.bundle.stages import Color, Linearise, Network, Undistort
from camkit.bundle.writer import write_bundle
from camkit.errors import UnsupportedError
from camkit.runtime.files.picture import read_scene
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.runtime.twin.truth import (
    ideal_picture,
    light_sensor,
    picture_scale,
    true_picture,
    write_truth,
)
from tests.bundle_factory import PITCH_UM, tiny_manifest, tiny_members, tiny_sensor
from tests.camera_factory import delta_psf, make_psf
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle
from tests.psf_factory import psnr_db


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give the tiny camera with a lens that distorts and does nothing else."""
    sensor = tiny_sensor()
    bent = make_psf(sensor, distortion=(1.0, -0.03, 0.0, 0.0)).distortion
    psf = delta_psf(sensor, distortion=bent, pixel_pitch_um=PITCH_UM)
    members = tiny_members() | {"psf.safetensors": psf_to_bytes(psf)}
    path = tmp_path_factory.mktemp("bundle") / "clear.camkit"
    write_bundle(path, tiny_manifest(sensor=sensor), members)
    return open_bundle(path)


def _smooth(height: int = 64, width: int = 96) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width]
    waves = [np.sin(x / (9 + c)) * np.cos(y / (8 - c)) for c in range(3)]
    return (0.4 + 0.15 * np.stack(waves)).astype(np.float32)


def test_a_clear_lens_gives_the_truth(bundle: Bundle) -> None:
    sensor = bundle.manifest.sensor
    found = simulate(_smooth(), sensor, bundle.psf, SimulationOptions(noise=False))
    truth = ideal_picture(found, bundle)
    close_db = {}
    for undistort in (True, False):
        pipeline = Pipeline(bundle, Options(method="develop", undistort=undistort))
        capture = pipeline.capture_of(
            found.samples, iso=100.0, white_balance=found.white_balance, origin_px=None
        )
        picture = pipeline.start(capture).fill()
        assert truth.shape == picture.shape
        close_db[undistort] = psnr_db(picture, truth, 8)
    assert close_db[True] > 45
    assert close_db[True] > close_db[False] + 3, "left bent, it is not where the truth is"


def test_the_truth_of_a_straight_picture_is_the_scene(bundle: Bundle) -> None:
    found = simulate(_smooth(), bundle.manifest.sensor, bundle.psf, SimulationOptions(noise=False))
    assert psnr_db(ideal_picture(found, bundle), _smooth(), 8) > 45


def test_the_truth_of_a_finer_picture_is_as_fine(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    ports = [Port(name="a", channels=1)], [Port(name="b", channels=1, scale=2)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
        Undistort(takes=("large",)),
        Color(),
    )
    sensor = planes_sensor()
    psf = make_psf(sensor, distortion=(1.0, -0.03, 0.0, 0.0))
    one = delta_psf(sensor, distortion=psf.distortion)
    single = one.distortion.__class__(
        coefficients=one.distortion.coefficients[:1], radius_mm=one.distortion.radius_mm
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=sensor,
        psf=delta_psf(sensor, distortion=single, pixel_pitch_um=PITCH_UM),
        networks={"restore": (facts_of(data, *ports), data)},
    )
    assert picture_scale(camera.manifest) == 2
    fine = _smooth(128, 192)
    found = simulate(fine, sensor, camera.psf, SimulationOptions(noise=False, scale=2))
    truth = ideal_picture(found, camera)
    assert found.samples.shape == (1, 64, 96)
    grey = np.tensordot(np.array([0.2126, 0.7152, 0.0722]), fine, axes=1)
    assert psnr_db(truth, np.stack([grey] * 3).astype(np.float32), 16) > 45


def test_channels_are_shown_as_colour_as_grey_or_not_at_all() -> None:
    planes = np.random.default_rng(0).random((5, 4, 6), dtype=np.float32)
    three = planes_sensor(("R", "G", "B"))
    np.testing.assert_array_equal(true_picture(planes[:3], three), planes[:3])
    grey = true_picture(planes[:1], planes_sensor())
    np.testing.assert_array_equal(grey, np.repeat(planes[:1], 3, axis=0))
    with pytest.raises(UnsupportedError, match="5 channels without a colour matrix"):
        true_picture(planes, planes_sensor(tuple("abcde")))


def test_a_camera_without_a_picture_or_light_has_no_such_truth(tmp_path: Path) -> None:
    stages = (Linearise(gives=("light",)),)
    camera = write_planes_bundle(tmp_path, stages, products={"depth": "light"})
    with pytest.raises(UnsupportedError, match="makes depth, and no product 'image'"):
        picture_scale(camera.manifest)
    diodes = SpadSensor(extent=Extent(width_px=8, height_px=6, pixel_pitch_um=6.0))
    counting = tiny_manifest().model_copy(update={"sensor": diodes})
    with pytest.raises(UnsupportedError, match="counts photons"):
        light_sensor(counting)


def test_the_truth_is_written_as_linear_rec709_and_never_below_zero(
    bundle: Bundle, tmp_path: Path
) -> None:
    scene = np.clip(_smooth() - 0.3, 0, None) * 900
    options = SimulationOptions(noise=False)
    shown = ideal_picture(simulate(scene, bundle.manifest.sensor, bundle.psf, options), bundle)
    write_truth(tmp_path / "truth.exr", shown)
    read = read_scene(tmp_path / "truth.exr")
    assert shown.min() < 0 <= read.min()
    np.testing.assert_allclose(read, np.maximum(shown, 0), rtol=2**-11, atol=1e-6)
    assert [path.name for path in tmp_path.iterdir()] == ["truth.exr"]

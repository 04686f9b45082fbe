"""A simulation is handed on with its place and light; cameras without three colours are refused."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import PlanesSensor, SpadSensor
from camkit.colorimetry import apply_matrix
from camkit.errors import UnsupportedError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.bundle_factory import tiny_sensor
from tests.wide_bundle import write_wide_bundle
from tools.capture.simulated import captured, color_sensor, rec709_of


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


def with_sensor(bundle: Bundle, sensor: PlanesSensor | SpadSensor) -> Bundle:
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"sensor": sensor}))


def planes_sensor(*channels: str) -> PlanesSensor:
    stated = tiny_sensor().model_dump(exclude={"type", "cfa", "color_matrix", "channel_response"})
    return PlanesSensor(**stated, channels=channels)


def test_grey_scenes_are_grey_in_rec709_and_captures_keep_their_place(bundle: Bundle) -> None:
    scene = np.full((3, 64, 96), 0.25, np.float32)
    sensor = color_sensor(bundle)
    taken = simulate(scene, sensor, bundle.psf, SimulationOptions(iso=400.0, origin_px=(18, 22)))
    np.testing.assert_allclose(apply_matrix(rec709_of(sensor), taken.clean), 0.25, rtol=1e-5)
    capture = captured(Pipeline(bundle, Options(method="develop", threads=1)), taken)
    assert (capture.origin_px, capture.iso) == ((18, 22), 400.0)
    assert capture.white_balance == taken.white_balance
    np.testing.assert_array_equal(capture.samples, taken.samples)


def test_three_planes_without_a_matrix_are_rec709_already(bundle: Bundle) -> None:
    sensor = color_sensor(with_sensor(bundle, planes_sensor("R", "G", "B")))
    np.testing.assert_array_equal(rec709_of(sensor), np.eye(3))


@pytest.mark.parametrize(
    ("sensor", "text"), [(planes_sensor("Y"), "gives Y"), (SpadSensor(), "counts photons")]
)
def test_a_camera_without_three_colours_is_refused_by_name(
    bundle: Bundle, sensor: PlanesSensor | SpadSensor, text: str
) -> None:
    with pytest.raises(UnsupportedError, match=f"tiny {text}"):
        color_sensor(with_sensor(bundle, sensor))

"""An array gets the meaning that a bundle's sensor gives it, or is refused with what would fit."""

from typing import Any

import numpy as np
import pytest

from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.sensor import Extent, PlanesSensor, Sensor, SpadSensor
from camkit.bundle.stages import Linearise, Parts
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.array_capture import capture_of_array
from camkit.runtime.capture import Capture
from tests.bundle_factory import tiny_manifest, tiny_sensor
from tests.planes_bundle import planes_sensor

MATRIX = ((0.9, -0.2, -0.1), (-0.4, 1.2, 0.2), (-0.1, 0.2, 0.7))


def _manifest(sensor: Sensor) -> Manifest:
    if sensor.type == "bayer":
        return tiny_manifest(sensor=sensor)
    if sensor.type == "spad":
        return tiny_manifest().model_copy(update={"sensor": sensor})
    stages = (Linearise(gives=("light",)),)
    parts = Parts(sensor=sensor, optics=None, networks={})
    return Manifest(
        name="planes",
        version="1.0.0",
        licence="Apache-2.0",
        training_data="untrained",
        sensor=sensor,
        stages=stages,
        planes=planes_of(stages, parts),
        products={"image": "light"},
    )


def _taken(image: Any, sensor: Sensor | None = None, **facts: Any) -> Capture:
    return capture_of_array(image, _manifest(sensor or tiny_sensor()), **facts)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
def test_a_mosaic_is_in_the_levels_and_the_cfa_of_the_sensor(kind: str) -> None:
    capture = _taken(np.full((6, 8), 200, kind), iso=400, white_balance=(2.0, 1.0, 1.5))
    assert (capture.cfa, capture.contract) == ("RGGB", "raw_bayer_v1")
    np.testing.assert_allclose(capture.linear_rows(0, 6), (200 - 64) / (1023 - 64), rtol=1e-6)
    assert (capture.iso, capture.white_balance) == (400, (2.0, 1.0, 1.5))
    np.testing.assert_array_equal(capture.color_matrix, tiny_sensor().color_matrix)
    assert (capture.bundle_name, capture.camera) == ("tiny", "tiny")


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
def test_planes_in_place_of_a_mosaic_are_linear_already(kind: str) -> None:
    capture = _taken(np.ones((3, 6, 8), kind))
    assert (capture.cfa, capture.contract) == (None, "linear_rgb_v1")
    np.testing.assert_array_equal(capture.linear_rows(0, 6), 1.0)


@pytest.mark.parametrize("channels", [("Y",), ("A", "B"), ("R", "G", "B"), tuple("abcdefg")])
def test_planes_of_a_sensor_are_in_its_levels_unless_they_are_float(
    channels: tuple[str, ...],
) -> None:
    sensor = planes_sensor(channels)
    count = len(channels)
    counted = _taken(np.full((count, 6, 8), 500, np.uint16), sensor)
    assert counted.contract == sensor.inputs[0]
    np.testing.assert_allclose(counted.linear_rows(0, 6), (500 - 64) / (1023 - 64), rtol=1e-6)
    linear = _taken(np.full((count, 6, 8), 0.25, np.float32), sensor)
    np.testing.assert_array_equal(linear.linear_rows(0, 6), 0.25)
    assert counted.color_matrix is linear.color_matrix is None


def test_a_colour_matrix_of_planes_comes_with_them() -> None:
    sensor = planes_sensor(("R", "G", "B"), color_matrix=MATRIX)
    capture = _taken(np.zeros((3, 6, 8), np.float32), sensor)
    np.testing.assert_array_equal(capture.color_matrix, MATRIX)


def test_a_crop_states_its_place_where_the_sensor_has_a_size() -> None:
    crop = _taken(np.zeros((6, 8), np.uint16), origin_px=(10, 4))
    assert (crop.origin_px, crop.sensor_size_px) == ((10, 4), (96, 64))
    assert _taken(np.zeros((6, 8), np.uint16)).sensor_size_px is None
    anywhere = planes_sensor(size_px=None)
    free = _taken(np.zeros((1, 6, 8), np.float32), anywhere, origin_px=(10, 4))
    assert free.sensor_size_px is None


PLANES: PlanesSensor = planes_sensor(("A", "B"))
BAYER = tiny_sensor()


@pytest.mark.parametrize(
    ("image", "sensor", "message"),
    [
        ([[1, 2], [3, 4]], BAYER, "expected a numpy array; got list"),
        (np.zeros((6, 8)), BAYER, "uint8, uint16 or float32 samples; got float64"),
        (np.full((6, 8), np.nan, np.float32), BAYER, "no finite sample"),
        (np.zeros((4, 6, 8), np.float32), BAYER, r"\(h, w\) or \(3, h, w\); got \(4, 6, 8\)"),
        (np.zeros(6, np.float32), BAYER, r"\(h, w\) or \(3, h, w\); got \(6,\)"),
        (np.zeros((3, 6, 8), np.float32), PLANES, r"expected \(2, h, w\); got \(3, 6, 8\)"),
        (np.zeros((6, 8), np.uint16), PLANES, r"takes linear_planes_v1; got an \(h, w\) mosaic"),
    ],
)
def test_an_array_that_does_not_fit_is_refused_with_what_would(
    image: Any, sensor: Sensor, message: str
) -> None:
    with pytest.raises(ContractError, match=message):
        _taken(image, sensor)


def test_photon_counts_are_for_the_kind_of_their_camera() -> None:
    diodes = SpadSensor(extent=Extent(width_px=8, height_px=6, pixel_pitch_um=6.0))
    with pytest.raises(UnsupportedError, match="counts photons"):
        _taken(np.zeros((6, 8), np.uint16), diodes)


@pytest.mark.parametrize(
    ("origin", "cfa"), [((0, 0), "RGGB"), ((3, 2), "GRBG"), ((2, 5), "GBRG"), ((7, 1), "BGGR")]
)
def test_a_crop_begins_with_the_pixel_of_the_cfa_at_its_place(
    origin: tuple[int, int], cfa: str
) -> None:
    crop = _taken(np.full((6, 8), 200, np.uint16), origin_px=origin)
    assert (crop.cfa, crop.origin_px) == (cfa, origin)


def test_a_float_mosaic_clips_at_the_white_level_of_its_sensor_and_planes_do_not() -> None:
    mosaic = np.full((6, 8), 200, np.float32)
    mosaic[2, 2] = 1023
    assert _taken(mosaic).saturated_rows(0, 6).sum() == 1
    assert _taken(np.full((3, 6, 8), 5, np.float32)).saturated_rows(0, 6).sum() == 0


def test_a_float_mosaic_that_holds_light_in_place_of_numbers_is_refused() -> None:
    with pytest.raises(ContractError, match=r"reaches 0\.9: multiply light by white - black"):
        _taken(np.linspace(-0.1, 0.9, 48, dtype=np.float32).reshape(6, 8))
    assert _taken(np.zeros((6, 8), np.float32)).linear_rows(0, 6).max() < 0

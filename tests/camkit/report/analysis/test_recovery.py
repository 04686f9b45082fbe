"""Whole frames restored by zones: the filter undoes blur, zones are rings."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.report.analysis.recovery import FILTER, filled, recover, zones_of
from camkit.report.analysis.subject import find_subject
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.scenes import procedural_scene
from tests.bundle_factory import tiny_sensor
from tests.haze_bundle import write_hazy_bundle


def _window(width: int = 200, height: int = 100) -> SensorWindow:
    return SensorWindow(
        size_px=(width, height),
        origin_px=(0, 0),
        sensor_size_px=(width, height),
        pitch_um=10.0,
        axis_px=None,
    )


def test_zones_are_rings_about_the_axis() -> None:
    zone = zones_of(_window(), 1, np.array([0.0, 0.5, 1.0]))
    assert zone[50, 100] == 0
    assert zone[50, 100 + 40] == 1
    assert zone[50, 100 - 40] == 1
    assert zone[50, 199] == 2
    # nothing belongs to the second of two fields at one height
    assert set(np.unique(zones_of(_window(), 1, np.array([0.0, 0.5, 0.5])))) == {0, 1}


def test_a_frame_is_filled_without_a_seam() -> None:
    picture = np.arange(12, dtype=np.float32).reshape(1, 3, 4).repeat(3, axis=0)
    frame = filled(picture, 9, 7)
    assert frame.shape == (3, 7, 9)
    np.testing.assert_array_equal(frame[:, :3, 4:8], picture[:, :, ::-1])


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    folder = tmp_path_factory.mktemp("recovery")
    return write_hazy_bundle(folder, sensor=tiny_sensor(192, 160))


def test_a_hazy_camera_gains_by_what_is_undone(camera: Bundle) -> None:
    scene = 0.8 * procedural_scene(5, 96, 96)
    found = recover(camera, [scene], np.array([0.0, 0.5, 9.0]), iso=100.0)
    assert found.method == FILTER
    capture, filtered, after = found.overall
    assert after == filtered
    assert after > capture + 1
    # no pixel of the frame lies nearest to the last height
    assert found.zones[0] is not None
    assert found.zones[2] is None


def test_a_bundle_is_found_by_its_file(camera: Bundle) -> None:
    subject = find_subject(str(camera.path))
    assert subject.kind == "bundle"
    assert subject.camera(camera.path.parent).manifest.name == camera.manifest.name

"""The warp as graphs limits what camkit limits, also where pixels come from beyond the border."""

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import onnxruntime
import pytest

from camkit.radial import RadialDistortion
from camkit.runtime.color import rec709_of_planes
from camkit.runtime.geometry.resampling import FLOOR, WHITE
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.portable.warp_graph import TILE_PX, places_graph, warp_graph
from camkit.runtime.rows import ArrayRows
from tools.portable_table import load_example

GROWTH = 1.03
"""Of all radii: places reach beyond every border, of 515 px by more than the last tile is wide."""
MATRIX = ((0.9, 0.1, 0.0), (0.2, 0.7, 0.1), (0.0, 0.2, 0.8))
SENSOR_PX = (800, 600)
ORIGIN_PX = (100, 40)
PITCH_MM = 0.004
ATOL = 5e-4
"""Of places in single precision, at the sharpest detail; a rim that is missed costs 0.04."""


def _facts() -> Any:
    coefficients = np.tile([GROWTH, 0.0, 0.0, 0.0], (3, 1))
    distortion = RadialDistortion(coefficients=coefficients, radius_mm=2.0)
    sensor = SimpleNamespace(color_matrix=MATRIX)
    return SimpleNamespace(
        bundle=SimpleNamespace(distortion=distortion), sensor=sensor, pitch_mm=PITCH_MM
    )


def _run(sessions: dict[str, Any], name: str, values: dict[str, Any]) -> dict[str, Any]:
    session = sessions[name]
    outputs = [one.name for one in session.get_outputs()]
    inputs = {one.name: values[one.name] for one in session.get_inputs()}
    return dict(zip(outputs, session.run(outputs, inputs), strict=True))


@pytest.mark.parametrize("size", [(97, 64), (TILE_PX + 3, 33), (33, TILE_PX + 3)])
def test_rims_of_lights_at_the_border_are_limited_as_in_camkit(size: tuple[int, int]) -> None:
    facts = _facts()
    graphs = [places_graph(facts), *(warp_graph(facts, limited=one) for one in (False, True))]
    sessions = {one.name: onnxruntime.InferenceSession(one.to_bytes()) for one in graphs}
    numbers = {"warp_px": TILE_PX, "warp_white": WHITE, "warp_floor": FLOOR}
    reader = SimpleNamespace(facts=numbers, run=partial(_run, sessions))
    rng = np.random.default_rng(5)
    lights = np.where(rng.random((3, size[1], size[0])) < 0.6, 1.3, 0.7)
    even = (lights + rng.uniform(-0.1, 0.1, lights.shape)).astype(np.float32)
    window = SensorWindow(
        size_px=size, origin_px=ORIGIN_PX, sensor_size_px=SENSOR_PX, pitch_um=PITCH_MM * 1000
    )
    axis = np.subtract(window.known_axis_px, ORIGIN_PX)
    found = load_example("portable_camera").PortableCamera.straighten(reader, even, axis)
    rules = {"interpolation": "cubic", "overshoot": "limited", "places": "fixed"}
    bands = undistort_bands(ArrayRows(even), facts.bundle.distortion, window, **rules)
    straight = np.concatenate(list(bands), axis=1)
    expected = np.tensordot(rec709_of_planes(np.array(MATRIX)), straight, 1)
    np.testing.assert_allclose(found, expected, atol=ATOL)

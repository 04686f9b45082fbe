"""A simulation as a capture of its camera, and the truth beside it as linear Rec.709."""

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import ColorSensor
from camkit.colorimetry import Matrix, rec709_from_camera
from camkit.errors import UnsupportedError
from camkit.runtime.capture import Capture
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation


def color_sensor(bundle: Bundle) -> ColorSensor:
    """Return the sensor of a camera that takes pictures in colour.

    Raises:
        UnsupportedError: If it has not three channels.
    """
    sensor = bundle.manifest.light_sensor
    if len(sensor.channels) != 3:
        raise UnsupportedError(
            f"this tool judges pictures in three colours; {bundle.manifest.name} gives "
            f"{', '.join(sensor.channels)}"
        )
    return sensor


def rec709_of(sensor: ColorSensor) -> Matrix:
    """Return the (3, 3) matrix from white-balanced channels to linear Rec.709."""
    if sensor.color_matrix is None:
        return np.eye(3)
    return rec709_from_camera(np.array(sensor.color_matrix, dtype=np.float64))


def captured(pipeline: Pipeline, simulation: Simulation) -> Capture:
    """Return the simulation as a capture that the pipeline of its camera takes."""
    red, green, blue = simulation.white_balance
    x, y = (int(v) for v in simulation.window.origin_px)
    capture: Capture = pipeline.capture_of(
        simulation.samples,
        iso=simulation.iso,
        white_balance=(red, green, blue),
        origin_px=(x, y),
    )
    return capture

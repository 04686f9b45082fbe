"""The truth beside a capture: the picture of a perfect camera, as a bundle's picture is.

clean planes of the twin -> ideal geometry, if the picture has it -> linear Rec.709 -> EXR
"""

from pathlib import Path

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.bundle.manifest import Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import RGB, ColorSensor
from camkit.colorimetry import apply_matrix, rec709_from_camera
from camkit.errors import UnsupportedError
from camkit.runtime.color import color_stage
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.writer import open_writer
from camkit.runtime.rows import ArrayRows
from camkit.runtime.twin.simulate import Simulation


def light_sensor(manifest: Manifest) -> ColorSensor:
    """Return the sensor of a camera that the twin can photograph with.

    Raises:
        UnsupportedError: If it counts photons.
    """
    return manifest.light_sensor


def picture_scale(manifest: Manifest) -> int:
    """Return the samples of a bundle's picture along a side of a pixel of its sensor.

    Raises:
        UnsupportedError: If it makes no picture, or one whose samples are not whole shares of a
            pixel.
    """
    if IMAGE not in manifest.products:
        names = ", ".join(manifest.products)
        raise UnsupportedError(f"bundle {manifest.name} makes {names}, and no product {IMAGE!r}")
    ratio = manifest.planes[manifest.products[IMAGE]].grid.pitch_ratio
    scale = max(round(1 / ratio), 1)
    if scale * ratio != 1:
        raise UnsupportedError(
            f"bundle {manifest.name} makes pictures with {ratio:g} pixels from sample to sample; "
            "the twin knows their truth for whole shares of a pixel only"
        )
    return scale


def true_picture(clean: FloatArray, sensor: ColorSensor) -> FloatArray:
    """Return linear Rec.709 (3, h, w) of clean planes of the twin.

    Args:
        clean: (c, h, w) float32, white-balanced channels of the sensor.
        sensor: What the channels are.

    Raises:
        UnsupportedError: If they are neither colours nor grey.
    """
    if sensor.color_matrix is not None:
        matrix = np.array(sensor.color_matrix, dtype=np.float64)
        return apply_matrix(rec709_from_camera(matrix), clean)
    if clean.shape[0] not in (1, len(RGB)):
        raise UnsupportedError(f"{clean.shape[0]} channels without a colour matrix have no colour")
    return clean if clean.shape[0] == len(RGB) else np.repeat(clean, len(RGB), axis=0)


def ideal_picture(simulation: Simulation, bundle: Bundle) -> FloatArray:
    """Return the ideal product `image` of a scene, without any loss.

    Args:
        simulation: Photographed with `picture_scale` samples of the scene along a side of a pixel.
        bundle: Of the camera.

    Returns:
        (3, h, w) float32 linear Rec.709 in the geometry of the picture.

    Raises:
        UnsupportedError: As `light_sensor` and `true_picture`.
    """
    manifest, clean = bundle.manifest, simulation.clean
    plane = manifest.planes[manifest.products[IMAGE]]
    if not plane.grid.warped:
        window = simulation.window.resampled(
            plane.grid.pitch_ratio, (clean.shape[2], clean.shape[1])
        )
        bands = undistort_bands(ArrayRows(clean), bundle.psf.distortion, window)
        clean = np.concatenate(list(bands), axis=1)
    return true_picture(clean, light_sensor(manifest))


def write_truth(path: Path, picture: FloatArray) -> None:
    """Write an `ideal_picture` as EXR: what `process` should give for the capture.

    Args:
        path: The file.
        picture: (3, h, w) float32 linear Rec.709; what interpolation left below zero is cut.

    Raises:
        OSError: If the file cannot be written.
    """
    _, height, width = picture.shape
    layout = PictureFormat(width=width, height=height, color=color_stage(None))
    with atomic_output(path) as part, open_writer(part, "exr", layout) as writer:
        writer.write(np.maximum(picture, 0))

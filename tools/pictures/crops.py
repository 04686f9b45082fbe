"""Crops of a simulated capture: as taken, restored by pipelines, and the sharp scene.

All lie in sensor geometry, so that the same pixel shows the same point in each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import apply_matrix, encode_srgb
from camkit.runtime.geometry.illumination import divide_illumination
from camkit.runtime.network.engine import available_threads
from camkit.runtime.signal.demosaic import demosaic
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph
from tools.capture.simulated import rec709_of

MARGIN_PX: Final = 96
"""Margin that is processed around a crop: its borders look as in the whole picture then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A rectangle of a capture.

    Attributes:
        corner_px: (x, y) of its first pixel, both even.
        size_px: (width, height).
    """

    corner_px: tuple[int, int]
    size_px: tuple[int, int]

    @classmethod
    def along_diagonal(
        cls, shape: tuple[int, int], size_px: tuple[int, int], share: float
    ) -> "Place":
        """Return the rectangle at a share of the way from the first corner to the last one."""
        height, width = shape
        wide, tall = size_px
        x, y = int((width - wide) * share), int((height - tall) * share)
        return cls(corner_px=(x // 2 * 2, y // 2 * 2), size_px=size_px)


def mosaic_sensor(bundle: Bundle) -> BayerSensor:
    """Return the sensor of a camera with a mosaic.

    Raises:
        SystemExit: If it has none.
    """
    sensor = bundle.manifest.sensor
    if not isinstance(sensor, BayerSensor):
        raise SystemExit(f"{bundle.manifest.name} has no mosaic; these pictures need one")
    return sensor


def take(
    scene: FloatArray,
    bundle: Bundle,
    origin_px: tuple[int, int],
    *,
    iso: float = 100.0,
    exposure: float = 0.5,
    depth_mm: float | None = None,
) -> Simulation:
    """Photograph a scene (3, h, w) at a place on the sensor, with noise."""
    options = SimulationOptions(
        iso=iso,
        seed=1,
        exposure=exposure,
        origin_px=(origin_px[0] // 2 * 2, origin_px[1] // 2 * 2),
        depth_mm=depth_mm,
        workers=available_threads(None),
    )
    return photograph(scene, bundle, options)


def crop_pictures(
    simulation: Simulation,
    bundle: Bundle,
    pipelines: Sequence[camkit.Pipeline],
    place: Place,
    *,
    iso: float = 100.0,
    margin_px: int = MARGIN_PX,
) -> list[FloatArray]:
    """Return a crop as taken, by every pipeline, and sharp; (3, h, w), sRGB values."""
    (x, y), (wide, tall) = place.corner_px, place.size_px
    left, top = max(x - margin_px, 0), max(y - margin_px, 0)
    window = np.s_[top : y + tall + margin_px, left : x + wide + margin_px]
    crop = np.s_[:, y - top : y - top + tall, x - left : x - left + wide]
    mosaic = np.ascontiguousarray(simulation.samples[window])
    x0, y0 = (int(v) for v in simulation.window.origin_px)
    red, green, blue = simulation.white_balance
    pictures = [_as_taken(mosaic, simulation, bundle, (x0 + left, y0 + top))]
    for pipeline in pipelines:
        image = pipeline.process_array(
            mosaic, iso=iso, white_balance=(red, green, blue), origin_px=(x0 + left, y0 + top)
        )
        pictures.append(image)
    sharp = simulation.clean[..., y : y + tall, x : x + wide]
    matrix = rec709_of(mosaic_sensor(bundle))
    tiles = (*(picture[crop] for picture in pictures), apply_matrix(matrix, sharp))
    return [encode_srgb(tile) for tile in tiles]


def psnr_db(picture: FloatArray, sharp: FloatArray, border_px: int) -> float:
    """Return the PSNR of sRGB values (3, h, w), a border left out, clipped to 0..1."""
    inside = np.s_[:, border_px:-border_px, border_px:-border_px]
    error = float(np.mean((np.clip(picture, 0, 1)[inside] - sharp[inside]) ** 2))
    return float(-10 * np.log10(max(error, 1e-12)))


def _as_taken(
    mosaic: NDArray[np.uint16],
    simulation: Simulation,
    bundle: Bundle,
    origin_px: tuple[int, int],
) -> FloatArray:
    """Return a crop demosaicked, white-balanced and without vignetting: what the lens saw."""
    sensor = mosaic_sensor(bundle)
    height, width = mosaic.shape
    x, y = map(float, origin_px)
    window = replace(simulation.window, size_px=(width, height), origin_px=(x, y))
    signal = mosaic.astype(np.float32) - np.float32(sensor.black_level)
    signal /= np.float32(sensor.white_level - sensor.black_level)
    planes = demosaic(signal, sensor.cfa)
    planes *= np.array(simulation.white_balance, np.float32)[:, None, None]
    planes = divide_illumination(planes, 0, bundle.psf, window)
    return apply_matrix(rec709_of(sensor), planes)


def around_brightest(picture: FloatArray, height_px: int, width_px: int) -> tuple[slice, ...]:
    """Return the rectangle of (3, h, w) around its brightest pixel, inside the picture."""
    _, height, width = picture.shape
    y, x = np.unravel_index(np.argmax(picture.sum(axis=0)), (height, width))
    top = int(np.clip(y - height_px // 2, 0, height - height_px))
    left = int(np.clip(x - width_px // 2, 0, width - width_px))
    return np.s_[:, top : top + height_px, left : left + width_px]

"""An array in memory as a capture of a bundle's sensor."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.manifest import Manifest
from camkit.bundle.sensor import BayerSensor
from camkit.cfa import shifted_cfa
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.options import Options, checked_origin

_LEAST_DN_WHITE: Final = 64
_MOST_LIGHT: Final = 1.5


def capture_of_array(
    image: NDArray[Any],
    manifest: Manifest,
    *,
    iso: float | None = None,
    white_balance: tuple[float, float, float] | None = None,
    origin_px: tuple[int, int] | None = None,
    options: Options | None = None,
) -> Capture:
    """Return an array the meaning that a bundle's sensor gives it.

    Args:
        image: (h, w) mosaic in DN, in the sensor's CFA and levels; or (c, h, w) planes: linear with
            1.0 = white level if they are float, else in the sensor's levels.
        manifest: Of the bundle.
        iso: For the noise model; None measures the noise.
        white_balance: Gains (R, G, B); None for what the bundle says.
        origin_px: (x, y) of the first pixel on the sensor, for a crop; None for a whole frame. An
            odd one begins the crop with another pixel of the CFA.
        options: What the caller chose; photographs mean the same whatever it is.

    Raises:
        ContractError: If shape or type do not fit the sensor.
        UnsupportedError: If the sensor counts photons.
    """
    del options
    _check_samples(image)
    sensor = manifest.light_sensor
    channels = len(sensor.channels)
    is_mosaic = image.ndim == 2
    if not is_mosaic and (image.ndim != 3 or image.shape[0] != channels):
        shapes = [f"({channels}, h, w)"]
        if isinstance(sensor, BayerSensor):
            shapes.insert(0, "(h, w)")
        raise ContractError(f"expected {' or '.join(shapes)}; got {image.shape}")
    if is_mosaic and not isinstance(sensor, BayerSensor):
        raise ContractError(f"the bundle takes {sensor.inputs[0]}; got an (h, w) mosaic")
    if origin_px is not None:
        origin_px = checked_origin(origin_px)
    is_float = np.issubdtype(image.dtype, np.floating)
    if is_mosaic and is_float:
        _check_float_mosaic(image, sensor.white_level)
    in_levels = is_mosaic or not (is_float or isinstance(sensor, BayerSensor))
    black = sensor.black_level if in_levels else 0.0
    matrix = sensor.color_matrix
    extent = sensor.extent
    return Capture(
        samples=image,
        cfa=shifted_cfa(sensor.cfa, origin_px or (0, 0)) if is_mosaic and sensor.cfa else None,
        black_level=np.full((2, 2) if is_mosaic else channels, black, np.float32),
        white_level=sensor.white_level if in_levels else 1.0,
        white_balance=white_balance,
        color_matrix=None if matrix is None else np.array(matrix, dtype=np.float64),
        iso=iso,
        origin_px=origin_px,
        sensor_size_px=(
            None if origin_px is None or extent is None else (extent.width_px, extent.height_px)
        ),
        bundle_name=manifest.name,
        camera=manifest.name,
    )


def _check_float_mosaic(mosaic: NDArray[np.float32], white_level: float) -> None:
    """Refuse a mosaic that seems to be linear light already, which would come out black."""
    finite = mosaic[np.isfinite(mosaic)]
    if white_level >= _LEAST_DN_WHITE and 0 < finite.max() <= _MOST_LIGHT:
        raise ContractError(
            f"a float mosaic is in DN as the sensor gives it (white {white_level:g}); this one "
            f"reaches {finite.max():g}: multiply light by white - black and add black"
        )


def _check_samples(image: Any) -> None:
    if not isinstance(image, np.ndarray):
        raise ContractError(f"expected a numpy array; got {type(image).__name__}")
    if 0 in image.shape:
        raise ContractError(f"the array holds no sample; got {image.shape}")
    if image.dtype == np.float32 and not np.isfinite(image).any():
        raise ContractError("the array holds no finite sample")
    if image.dtype not in (np.uint8, np.uint16, np.float32):
        raise ContractError(f"expected uint8, uint16 or float32 samples; got {image.dtype}")

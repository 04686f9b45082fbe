"""Networks that look at the whole picture: one window must hold every picture of the camera."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor, ColorSensor
from camkit.errors import ContractError, ParityError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline


def prove_one_window(bundle: Bundle, role: str, size: str) -> str:
    """Check that a whole picture of the sensor takes one window within the usual memory cap.

    Args:
        bundle: The bundle.
        role: Of a network with `global_operators`.
        size: Of it.

    Returns:
        What was shown.

    Raises:
        ParityError: If it is not, or the sensor takes pictures of any size: then pictures would
            have to be tiled, and that is refused in mode exact.
    """
    cannot = f"cannot be tiled ({bundle.network_facts(role, size).global_text})"
    if bundle.manifest.sensor.plane.domain == "counts":
        return f"{cannot}; photons are never tiled"
    sensor = bundle.manifest.light_sensor
    if sensor.extent is None:
        raise ParityError(
            f"size {size}: {cannot}, and the sensor takes pictures of any size: state its extent, "
            "or export a network that looks at windows"
        )
    pixels = f"{sensor.extent.width_px}x{sensor.extent.height_px} px of the sensor"
    pipeline = Pipeline(bundle, Options(size=size, threads=1))
    grey = _grey(sensor, (sensor.extent.height_px, sensor.extent.width_px))
    capture = pipeline.capture_of(grey, iso=sensor.noise[0].iso, white_balance=None, origin_px=None)
    try:
        pipeline.start(capture)
    except ContractError as error:
        raise ParityError(
            f"size {size}: {cannot}, and the {pixels} do not fit in one window: {error}; or export "
            "a network that looks at windows"
        ) from error
    return f"{cannot}; one window holds the {pixels}"


def _grey(sensor: ColorSensor, size_px: tuple[int, int]) -> NDArray[Any]:
    """Return a grey capture of the whole sensor."""
    if isinstance(sensor, BayerSensor):
        return np.full(size_px, sensor.white_level // 4, np.uint16)
    return np.full((len(sensor.channels), *size_px), 0.25, np.float32)

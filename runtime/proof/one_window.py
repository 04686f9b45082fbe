"""Networks that look at the whole picture: one window must hold every picture of the camera."""

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor, SpadSensor
from camkit.errors import ContractError, ParityError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline


def prove_one_window(bundle: Bundle, role: str, size: str) -> str:
    """Show that a whole picture of the sensor is planned in one window within the usual memory cap.

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
    sensor = bundle.manifest.sensor
    if isinstance(sensor, SpadSensor):
        return f"{cannot}; photons are never tiled"
    if sensor.extent is None:
        raise ParityError(
            f"size {size}: {cannot}, and the sensor takes pictures of any size: state its extent, "
            "or export a network that looks at windows"
        )
    pixels = f"{sensor.extent.width_px}x{sensor.extent.height_px} px of the sensor"
    try:
        _plan(bundle, size, (sensor.extent.height_px, sensor.extent.width_px), sensor.noise[0].iso)
    except ContractError as error:
        raise ParityError(
            f"size {size}: {cannot}, and the {pixels} do not fit in one window: {error}; or export "
            "a network that looks at windows"
        ) from error
    return f"{cannot}; one window holds the {pixels}"


def _plan(bundle: Bundle, size: str, size_px: tuple[int, int], iso: float) -> None:
    """Plan a grey capture of the whole sensor."""
    sensor = bundle.manifest.sensor
    if isinstance(sensor, BayerSensor):
        grey = np.full(size_px, sensor.white_level // 4, np.uint16)
    else:
        grey = np.full((len(sensor.channels), *size_px), 0.25, np.float32)
    pipeline = Pipeline(bundle, Options(size=size, threads=1))
    given = pipeline.capture_of(grey, iso=iso, white_balance=None, origin_px=None)
    pipeline.start(given)

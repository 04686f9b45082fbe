"""Where a capture lies on a bundle's sensor, or why it does not.

Size, and pitch where the file states it, must match the sensor; a crop that records its origin is
honoured; anything else needs the caller's word: `assume="centre"` (same pitch, picture centre on
the axis) or `assume="scale"` (the picture spans the sensor, kernels scaled by the width ratio).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage

from camkit.bundle.manifest import Camera
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.options import Assumption

PITCH_TOLERANCE: Final = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """The capture's place on the sensor, in the capture's own pixels.

    Attributes:
        window: The capture as a window on the sensor.
        kernel_scale: Width ratio by which kernels must be scaled; 1 unless `assume="scale"`.
        note: What was assumed, for the sidecar; empty when nothing was.
    """

    window: SensorWindow
    kernel_scale: float = 1.0
    note: str = ""


def place(capture: Capture, camera: Camera, assume: Assumption | None) -> Placement:
    """Find the place of a capture on the bundle's sensor.

    Args:
        capture: The decoded capture.
        camera: The bundle's camera.
        assume: What the caller vouches for where size or pitch do not match.

    Raises:
        ContractError: If the capture does not fit the sensor and nothing was assumed.
    """
    sensor = (camera.width_px, camera.height_px)
    size = (capture.width, capture.height)
    pitch = camera.pixel_pitch_um
    if assume == "scale":
        return _scaled(size, sensor, pitch)
    if assume == "centre":
        origin = ((sensor[0] - size[0]) / 2, (sensor[1] - size[1]) / 2)
        return Placement(
            window=_window(size, origin, sensor, pitch),
            note=f"assumed centred on the axis at {pitch} um pitch, origin {origin}",
        )
    _check_pitch(capture, pitch)
    if capture.origin_px is not None and capture.sensor_size_px == sensor:
        return _recorded(capture, capture.origin_px, camera)
    if size == sensor:
        return Placement(window=_window(size, (0.0, 0.0), sensor, pitch))
    raise ContractError(
        f"the capture has {size[0]}x{size[1]} pixels, the bundle's sensor {sensor[0]}x{sensor[1]}; "
        "for a crop say where it lies (origin_px), else use another bundle, or --assume centre "
        "(same pitch) or --assume scale"
    )


def _window(
    size: tuple[int, int],
    origin: tuple[float, float],
    sensor: tuple[int, int],
    pitch_um: float,
) -> SensorWindow:
    return SensorWindow(size_px=size, origin_px=origin, sensor_size_px=sensor, pitch_um=pitch_um)


def _scaled(size: tuple[int, int], sensor: tuple[int, int], pitch_um: float) -> Placement:
    ratio = size[0] / sensor[0]
    return Placement(
        window=_window(size, (0.0, 0.0), size, pitch_um / ratio),
        kernel_scale=ratio,
        note=f"assumed to span the sensor: kernels scaled by {ratio:.4g}",
    )


def _check_pitch(capture: Capture, pitch_um: float) -> None:
    stated = capture.pixel_pitch_um
    if stated is not None and abs(stated / pitch_um - 1) > PITCH_TOLERANCE:
        raise ContractError(
            f"the capture states a pixel pitch of {stated:g} um, the bundle's sensor has "
            f"{pitch_um:g} um; use another bundle or --assume scale"
        )


def _recorded(capture: Capture, origin: tuple[float, float], camera: Camera) -> Placement:
    right, bottom = origin[0] + capture.width, origin[1] + capture.height
    if min(origin) < 0 or right > camera.width_px or bottom > camera.height_px:
        raise ContractError(
            f"the recorded crop {capture.width}x{capture.height} at {origin} leaves the sensor "
            f"{camera.width_px}x{camera.height_px}"
        )
    return Placement(
        window=_window(
            (capture.width, capture.height),
            (float(origin[0]), float(origin[1])),
            (camera.width_px, camera.height_px),
            camera.pixel_pitch_um,
        )
    )


def scale_kernels(kernels: FloatArray, ratio: float) -> FloatArray:
    """Scale (field, 3, h, w) kernels about their centres, odd sides and sums of 1 kept.

    Args:
        kernels: (field, 3, h, w) float32, each sums to 1.
        ratio: New pixels per old pixel; > 0.
    """
    if ratio <= 0:
        raise ContractError(f"the scale of kernels must be > 0; got {ratio}")
    if ratio == 1.0:
        return kernels
    old = kernels.shape[-1]
    half = max(1, int(np.ceil((old // 2) * ratio)))
    # Blurring to the coarser grid first keeps energy that falls between the new samples.
    source = kernels
    if ratio < 1.0:
        sigma = 0.5 * np.sqrt(1 / ratio**2 - 1)
        source = scipy.ndimage.gaussian_filter(kernels, (0, 0, sigma, sigma), mode="constant")
    at = np.arange(-half, half + 1) / ratio + old // 2
    grid = np.meshgrid(at, at, indexing="ij")
    scaled = np.stack(
        [
            scipy.ndimage.map_coordinates(k, grid, order=1, mode="constant")
            for k in source.reshape(-1, old, old)
        ]
    ).reshape(*kernels.shape[:2], 2 * half + 1, 2 * half + 1)
    return np.asarray(scaled / scaled.sum(axis=(-2, -1), keepdims=True), dtype=np.float32)

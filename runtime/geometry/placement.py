"""The place of a capture on a bundle's sensor, or the reason why it has none.

Size, and pitch where the file states it, must match the sensor; a crop that records its origin is
honoured; anything else needs a statement of the caller: `assume="centre"` (same pitch, picture
centre on the axis) or `assume="scale"` (the picture spans the sensor, kernels scaled by the width
ratio).
"""

from dataclasses import dataclass, replace
from typing import Final

from camkit.bundle.sensor import Extent
from camkit.caller import option_text
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
        kernel_scale: Width ratio by which kernels must be scaled; 1 unless `assume="scale"`, or
            the capture is binned.
        note: What was assumed, for the sidecar; empty when nothing was.
    """

    window: SensorWindow
    kernel_scale: float = 1.0
    note: str = ""

    def binned(self, bin_px: int) -> "Placement":
        """Return the place of a capture that was binned over squares of some pixels."""
        width, height = (side // bin_px for side in self.window.size_px)
        return replace(
            self,
            window=self.window.resampled(bin_px, (width, height)),
            kernel_scale=self.kernel_scale / bin_px,
        )


def place(capture: Capture, extent: Extent | None, assume: Assumption | None) -> Placement:
    """Find the place of a capture on the bundle's sensor.

    Args:
        capture: The decoded capture.
        extent: Of the bundle's sensor; None where it takes pictures of any size.
        assume: What the caller vouches for where size or pitch do not match.

    Raises:
        ContractError: If the capture does not fit the sensor and nothing was assumed.
    """
    size = (capture.width, capture.height)
    if extent is None:
        pitch_um = capture.pixel_pitch_um or 1.0
        return Placement(
            window=SensorWindow(
                size_px=size, origin_px=(0.0, 0.0), sensor_size_px=size, pitch_um=pitch_um
            )
        )
    sensor = (extent.width_px, extent.height_px)
    pitch = extent.pixel_pitch_um
    if assume == "scale":
        return _scaled(size, extent)
    if assume == "centre":
        axis_x, axis_y = extent.axis_px
        origin = (axis_x - (size[0] - 1) / 2, axis_y - (size[1] - 1) / 2)
        return Placement(
            window=_window(size, origin, extent),
            note=f"assumed to be a centred crop at {pitch} um pitch, origin {origin}",
        )
    _check_pitch(capture, pitch)
    if capture.origin_px is not None and capture.sensor_size_px == sensor:
        return _recorded(capture, capture.origin_px, extent)
    if size == sensor:
        return Placement(window=_window(size, (0.0, 0.0), extent))
    raise ContractError(
        f"the capture has {size[0]}x{size[1]} pixels, the bundle's sensor {sensor[0]}x{sensor[1]}: "
        "it is not a whole frame of that camera; use the bundle of its lens. If this lens did take "
        f"it: for a crop, add its position ({option_text('origin_px')}), else use "
        f"{option_text('assume', 'centre')} (same pitch) or {option_text('assume', 'scale')}"
    )


def _window(size: tuple[int, int], origin: tuple[float, float], extent: Extent) -> SensorWindow:
    return SensorWindow(
        size_px=size,
        origin_px=origin,
        sensor_size_px=(extent.width_px, extent.height_px),
        pitch_um=extent.pixel_pitch_um,
        axis_px=extent.optical_centre_px,
    )


def _scaled(size: tuple[int, int], extent: Extent) -> Placement:
    ratio = size[0] / extent.width_px
    axis = extent.optical_centre_px
    return Placement(
        window=SensorWindow(
            size_px=size,
            origin_px=(0.0, 0.0),
            sensor_size_px=size,
            pitch_um=extent.pixel_pitch_um / ratio,
            axis_px=axis and ((axis[0] + 0.5) * ratio - 0.5, (axis[1] + 0.5) * ratio - 0.5),
        ),
        kernel_scale=ratio,
        note=f"assumed to show the whole sensor: kernels are scaled by {ratio:.4g}",
    )


def _check_pitch(capture: Capture, pitch_um: float) -> None:
    capture_um = capture.pixel_pitch_um
    if capture_um is not None and abs(capture_um / pitch_um - 1) > PITCH_TOLERANCE:
        raise ContractError(
            f"the capture states a pixel pitch of {capture_um:g} um, the bundle's sensor has "
            f"{pitch_um:g} um; use another bundle or {option_text('assume', 'scale')}"
        )


def _recorded(capture: Capture, origin: tuple[float, float], extent: Extent) -> Placement:
    right, bottom = origin[0] + capture.width, origin[1] + capture.height
    if min(origin) < 0 or right > extent.width_px or bottom > extent.height_px:
        raise ContractError(
            f"the recorded crop {capture.width}x{capture.height} at {origin} leaves the sensor "
            f"{extent.width_px}x{extent.height_px}"
        )
    size = (capture.width, capture.height)
    return Placement(window=_window(size, (float(origin[0]), float(origin[1])), extent))

"""The window of a capture on its sensor: pixel positions to millimetres from the optical axis."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]
PixelGrid = NDArray[np.floating[Any] | np.integer[Any]] | float


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorWindow:
    """A capture as a window on its sensor; positions are those from the optical axis.

    Attributes:
        size_px: (width, height) of the capture.
        origin_px: (x, y) of its top left pixel on the sensor; may be half-integer.
        sensor_size_px: (width, height) of the whole sensor.
        pitch_um: Pixel pitch.
        axis_px: (x, y) on the sensor where the optical axis meets it; None for its middle.
    """

    size_px: tuple[int, int]
    origin_px: tuple[float, float]
    sensor_size_px: tuple[int, int]
    pitch_um: float
    axis_px: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if min(self.size_px) < 1 or not (np.isfinite(self.pitch_um) and self.pitch_um > 0):
            raise ContractError(
                f"a window needs sides >= 1 and a pitch > 0; got {self.size_px}, {self.pitch_um}"
            )
        if not np.isfinite([*self.origin_px, *(self.axis_px or ())]).all():
            raise ContractError(
                f"origin and axis must be finite; got {self.origin_px}, {self.axis_px}"
            )

    @property
    def known_axis_px(self) -> tuple[float, float]:
        """Return (x, y) on the sensor where the optical axis meets it."""
        width, height = self.sensor_size_px
        return self.axis_px or ((width - 1) / 2, (height - 1) / 2)

    @property
    def centre_mm(self) -> FloatGrid:
        """Return (x, y) of the middle of the window from the axis."""
        width, height = self.size_px
        return np.array(self.to_mm((width - 1) / 2, (height - 1) / 2), dtype=np.float64)

    @property
    def corner_radius_mm(self) -> float:
        """Return the largest distance of a pixel of the window from the axis."""
        width, height = self.size_px
        x_mm, y_mm = self.to_mm(np.array([0, width - 1.0]), np.array([0, height - 1.0]))
        return float(np.hypot(np.abs(x_mm).max(), np.abs(y_mm).max()))

    def widened(self, px: int) -> "SensorWindow":
        """Return a window with more pixels on every side, even beyond the sensor."""
        (x, y), (width, height) = self.origin_px, self.size_px
        return replace(self, size_px=(width + 2 * px, height + 2 * px), origin_px=(x - px, y - px))

    def resampled(self, ratio: float, size_px: tuple[int, int]) -> "SensorWindow":
        """Return the same window in samples of another distance.

        Args:
            ratio: Distance of the new samples over that of the old ones.
            size_px: (width, height) in new samples.
        """
        axis_x, axis_y = ((at + 0.5) / ratio - 0.5 for at in self.known_axis_px)
        (x, y), (width, height) = self.origin_px, self.sensor_size_px
        return replace(
            self,
            size_px=size_px,
            origin_px=(x / ratio, y / ratio),
            sensor_size_px=(round(width / ratio), round(height / ratio)),
            pitch_um=self.pitch_um * ratio,
            axis_px=(axis_x, axis_y),
        )

    def to_mm(self, x_px: PixelGrid, y_px: PixelGrid) -> tuple[FloatGrid, FloatGrid]:
        """Return the sensor position of pixel positions of the capture (0, 0 = top left pixel)."""
        (x0, y0), (axis_x, axis_y) = self.origin_px, self.known_axis_px
        pitch_mm = to_mm(self.pitch_um)
        x_mm = (np.asarray(x_px, dtype=np.float64) + (x0 - axis_x)) * pitch_mm
        y_mm = (np.asarray(y_px, dtype=np.float64) + (y0 - axis_y)) * pitch_mm
        return x_mm, y_mm

    def to_px(self, x_mm: FloatGrid, y_mm: FloatGrid) -> tuple[FloatGrid, FloatGrid]:
        """Return the pixel position in the capture of sensor positions; inverse of `to_mm`."""
        (x0, y0), (axis_x, axis_y) = self.origin_px, self.known_axis_px
        pitch_mm = to_mm(self.pitch_um)
        return x_mm / pitch_mm + (axis_x - x0), y_mm / pitch_mm + (axis_y - y0)


def centred_origin(
    size_px: tuple[int, int], sensor_size_px: tuple[int, int], *, multiple: int = 2
) -> tuple[int, int]:
    """Return the origin that centres a window on the sensor, rounded down to the CFA cell."""
    x, y = (
        max((whole - side) // 2, 0) // multiple * multiple
        for side, whole in zip(size_px, sensor_size_px, strict=True)
    )
    return x, y

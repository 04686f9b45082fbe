"""Relative illumination of the lens: over the sensor, and divided out of a picture."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.psf import FrozenPsf
from camkit.radial import RadialIllumination
from camkit.runtime.geometry.sensor_window import FloatGrid, SensorWindow

TABLE_SAMPLES: Final = 4096
GAIN_SAMPLES: Final = 1 << 21
"""So many that the nearest one errs by less than 1e-6 for any lens that halves its light."""


def illumination_band(psf: FrozenPsf, window: SensorWindow, top: int, bottom: int) -> FloatArray:
    """Return the relative illumination of rows top..bottom of a window.

    Linear in the squared field height between the samples of the PSF, since the illumination is
    an even function of the height; constant beyond the last one.

    Args:
        psf: Frozen PSF; its relative illumination is 1 on the axis.
        window: Where the picture lies on the sensor.
        top: First row.
        bottom: Row after the last.

    Returns:
        (bottom - top, w) float32 > 0.
    """
    width, _ = window.size_px
    x_mm, y_mm = window.to_mm(np.arange(width), np.arange(top, bottom))
    if psf.grid_x_mm is not None and psf.grid_y_mm is not None:
        return _on_grid(psf, x_mm, y_mm)
    # A table over the squared height makes the lookup two multiplications per pixel.
    end = max(window.corner_radius_mm, 1e-9) ** 2 * (1 + 1e-6)
    squares = np.linspace(0.0, end, TABLE_SAMPLES)
    table = np.interp(squares, psf.field_heights_mm**2, psf.relative_illumination)
    table32 = np.append(table, table[-1]).astype(np.float32)
    scale = (TABLE_SAMPLES - 1) / end
    at = (x_mm**2 * scale).astype(np.float32) + (y_mm**2 * scale).astype(np.float32)[:, None]
    index = at.astype(np.int32)
    at -= index
    low = table32[index]
    return np.asarray(low + at * (table32[index + 1] - low), dtype=np.float32)


def _on_grid(psf: FrozenPsf, x_mm: FloatGrid, y_mm: FloatGrid) -> FloatArray:
    """Return illumination (row, column) between the positions of a grid; its rim holds beyond."""
    assert psf.grid_x_mm is not None
    assert psf.grid_y_mm is not None
    table = psf.relative_illumination.reshape(psf.grid_y_mm.size, psf.grid_x_mm.size)
    rows = np.stack([np.interp(x_mm, psf.grid_x_mm, row) for row in table])
    hats = np.stack([np.interp(y_mm, psf.grid_y_mm, unit) for unit in np.eye(psf.grid_y_mm.size)])
    return np.asarray(hats.T @ rows, dtype=np.float32)


def divide_illumination(
    band: FloatArray, top: int, psf: FrozenPsf, window: SensorWindow
) -> FloatArray:
    """Undo vignetting on a band of a picture in sensor geometry; see `IlluminationGain`.

    Args:
        band: (c, rows, w) float32, linear.
        top: First row of the band in the picture.
        psf: Frozen PSF.
        window: Where the picture lies on the sensor.

    Returns:
        (c, rows, w) float32, a new array.
    """
    return IlluminationGain(psf, window).divide(band, top)


class IlluminationGain:
    """One over the relative illumination of a window.

    Sampled by the squared field height: looked up in a table where the picture has more pixels
    than that, else computed for each pixel. On a grid of fields, computed band by band.
    """

    def __init__(self, optics: FrozenPsf | RadialIllumination, window: SensorWindow) -> None:
        """Compute the table.

        Args:
            optics: Frozen PSF, whose relative illumination is 1 on the axis, or that alone.
            window: Where the picture lies on the sensor.
        """
        self._window = window
        self._table: FloatArray | None = None
        self._grid: FrozenPsf | None = None
        if isinstance(optics, RadialIllumination):
            radial = optics
        elif optics.radial_illumination is not None:
            radial = optics.radial_illumination
        else:
            self._grid = optics
            return
        width, height = window.size_px
        x_mm, y_mm = window.to_mm(np.arange(width), np.arange(height))
        end = max(window.corner_radius_mm, 1e-9) ** 2 * (1 + 1e-6)
        self._squares = np.linspace(0.0, end, TABLE_SAMPLES)
        self._coarse = np.interp(self._squares, radial.heights_mm**2, radial.light)
        self._step = end / GAIN_SAMPLES
        if width * height > GAIN_SAMPLES:
            # Rounded one by one, the two indices of a pixel may sum to one more than the last.
            self._table = self._gains(np.arange(GAIN_SAMPLES + 1))
        scale = (GAIN_SAMPLES - 1) / end
        self._columns = np.rint(x_mm**2 * scale).astype(np.intp)
        self._rows = np.rint(y_mm**2 * scale).astype(np.intp)

    def divide(self, band: FloatArray, top: int, out: FloatArray | None = None) -> FloatArray:
        """Undo vignetting on a (c, rows, w) band that starts at row `top`.

        Fills `out`, which may be the band, or a new array.
        """
        bottom = top + band.shape[1]
        if self._grid is not None:
            light = illumination_band(self._grid, self._window, top, bottom)
            return np.asarray(np.divide(band, light, out=out))
        index = self._rows[top:bottom, None] + self._columns
        gain = self._gains(index) if self._table is None else self._table.take(index, mode="clip")
        return np.asarray(np.multiply(band, gain, out=out))

    def _gains(self, index: NDArray[np.intp]) -> FloatArray:
        """Return the samples of these numbers."""
        gains = 1 / np.interp(index * self._step, self._squares, self._coarse)
        return np.asarray(gains, dtype=np.float32)

"""The image of a point: its peak, its spread along and across the radius, its light by distance.

All light that arrives is 1. Lines spread `radial` tell of detail that varies along the radius of
the field, `tangential` of detail that varies across it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
import scipy.ndimage
import scipy.signal
from numpy.typing import NDArray

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError

Array = NDArray[np.float64]
Direction = Literal["radial", "tangential"]

DIRECTIONS: Final[tuple[Direction, Direction]] = ("radial", "tangential")
PEAK_PX: Final = 5.0
"""Radius of the disc that finds the peak: its densest place."""
NEAR_PX: Final = 10.0
FAR_PX: Final = 900.0
PATCH_PX: Final = 64
"""Reach of the patch about the peak."""
WAVELENGTHS: Final = 9
"""Of the middle colour."""
LEAST_RESPONSE: Final = 0.02
"""Of the largest: wavelengths beyond are left out."""
_FINER: Final = 8
_MOST_SHIFT_PX: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The colour in which points are looked at.

    Attributes:
        wavelengths_um: (n,), increasing.
        weights: (n,) > 0, of sum 1.
    """

    wavelengths_um: Array
    weights: Array


def band_of(sensor: ColorSensor, wavelength_um: float | None = None) -> Band:
    """Return the middle colour of a sensor, or one wavelength.

    Raises:
        ContractError: If the wavelength is not > 0.
    """
    if wavelength_um is not None:
        if not (np.isfinite(wavelength_um) and wavelength_um > 0):
            raise ContractError(f"a wavelength must be > 0 um; got {wavelength_um}")
        return Band(wavelengths_um=np.array([wavelength_um]), weights=np.ones(1))
    response_um, response = sensor.response_arrays()
    row = response[len(sensor.channels) // 2]
    sensitive_um = response_um[row > LEAST_RESPONSE * row.max()]
    waves_um = np.linspace(
        sensitive_um[0], sensitive_um[-1], WAVELENGTHS if sensitive_um.size > 1 else 1
    )
    weights = np.interp(waves_um, response_um, row)
    return Band(wavelengths_um=waves_um, weights=np.asarray(weights / weights.sum()))


@dataclass(frozen=True, slots=True, kw_only=True)
class PointImage:
    """Image of a point of one colour at one place of the sensor.

    Attributes:
        height_mm: Of the peak, from the axis.
        field_angle_rad: Of the point; None where nobody knows the focal length.
        patch: (n, n) light by pixel about the peak, n odd, rows increasing outward.
        lines: Direction -> (m,) light by pixel, m odd, summed over the other direction; the middle
            is the peak, and all light that arrives is in it.
        near_share: Within `NEAR_PX` of the peak.
        far_share: Within `FAR_PX` of the peak.
        lost_share: Of the light that enters, what never arrives; None where nobody knows.
        illumination: Of an even scene at this place, 1 on the axis.
    """

    height_mm: float
    field_angle_rad: float | None
    patch: Array
    lines: Mapping[Direction, Array]
    near_share: float
    far_share: float
    lost_share: float | None = None
    illumination: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is no image of a point.

        Raises:
            ContractError: If a side is even, or light is missing or not finite.
        """
        arrays = [self.patch, *self.lines.values()]
        if any(side % 2 == 0 for array in arrays for side in array.shape):
            raise ContractError(
                f"an image of a point has odd sides; got {[a.shape for a in arrays]}"
            )
        if not all(np.isfinite(array).all() and array.sum() > 0 for array in arrays):
            raise ContractError("an image of a point must be finite and hold light")

    @property
    def fwhm_px(self) -> float:
        """Return the width of the peak: the diameter of a disc of the area above half its height.

        Only what is joined to the highest place counts, on a grid eight times finer than pixels,
        linear between them.
        """
        fine = _finer(self.patch)
        regions, _ = scipy.ndimage.label(fine >= fine.max() / 2)
        here = regions[np.unravel_index(int(fine.argmax()), fine.shape)]
        return float(2 * np.sqrt((regions == here).sum() / np.pi) / _FINER)

    def mtf(self, direction: Direction, cycles_per_px: Array) -> Array:
        """Return the modulation transfer at spatial frequencies, that of the pixel included.

        Args:
            direction: In which the sinusoid varies.
            cycles_per_px: (n,) >= 0.
        """
        line = self.lines[direction]
        place = np.arange(line.size) - line.size // 2
        waves = np.exp(-2j * np.pi * cycles_per_px[:, None] * place)
        return np.asarray(np.abs(waves @ line) / line.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Place of the peak of light by pixel.

    Attributes:
        row: Of the pixel.
        column: Of the pixel.
        patch: (n, n) about it, zero beyond what is known.
    """

    row: int
    column: int
    patch: Array = field(repr=False)


def find_peak(light: Array) -> Peak:
    """Find the middle of the disc of `PEAK_PX` that holds most light.

    Of several that hold as much it is the mean: of a plateau its middle, of two that mirror each
    other a place on the meridian between them.

    Args:
        light: (h, w) by pixel.
    """
    if min(light.shape) <= 1:
        row, column = (side // 2 for side in light.shape)
    else:
        disc_light = scipy.signal.fftconvolve(light, disc(PEAK_PX), mode="same")
        disc_light[disc_light < disc_light.max() * (1 - 1e-9)] = 0
        row, column = (round(float(v.mean())) for v in np.nonzero(disc_light))
    padded = np.pad(light, PATCH_PX)
    cut = padded[row : row + 2 * PATCH_PX + 1, column : column + 2 * PATCH_PX + 1]
    return Peak(row=row, column=column, patch=cut.copy())


def disc(radius_px: float) -> Array:
    """Return (n, n) of 1 where the middle of a pixel lies within a radius, 0 elsewhere."""
    reach = int(radius_px)
    offset = np.arange(-reach, reach + 1)
    return np.asarray(np.hypot(offset[:, None], offset) < radius_px, np.float64)


def likeness(first: PointImage, second: PointImage) -> float:
    """Return the correlation of two peaks, where they lie best upon each other: 1 for equal ones.

    The largest sum of products over shifts of up to 16 whole pixels, both patches scaled to 1.
    """
    one, other = (image.patch / np.linalg.norm(image.patch) for image in (first, second))
    products = scipy.signal.fftconvolve(one, other[::-1, ::-1], mode="same")
    middle = np.array(products.shape) // 2
    inside = tuple(slice(m - _MOST_SHIFT_PX, m + _MOST_SHIFT_PX + 1) for m in middle)
    return float(min(products[inside].max(), 1.0))


def _finer(patch: Array) -> Array:
    """Return a patch on a grid `_FINER` times finer, linear between the pixels."""
    return np.asarray(
        scipy.ndimage.zoom(patch, _FINER, order=1, grid_mode=True, mode="grid-constant")
    )

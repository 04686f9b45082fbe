"""A pinhole: no lens at all, a round hole in front of a sensor, blurred by shadow and diffraction.

The light of a point through the hole is a plane wave cut to a disc, which goes on to the sensor by
Fresnel's integral. A wide hole shows its own shadow, a narrow one the rings of Airy.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.freezable_optics import FieldLayout, FloatGrid, radial_layout
from camkit.models_def.optics.psf import TracedPsf
from camkit.radial import RadialDistortion
from camkit.units import to_mm

WAVELENGTHS_UM: Final = (0.42, 0.463, 0.507, 0.55, 0.593, 0.637, 0.68)
"""At which it is known."""
MOST_SIDE: Final = 4096
"""Of the grid of the wave."""
_EDGE_PARTS: Final = 8
REFERENCE_UM: Final = 0.55


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinhole:
    """A round hole; fulfils `camkit.models_def.optics.freezable_optics.Optics`.

    Attributes:
        diameter_mm: Of the hole.
        distance_mm: From hole to sensor, its focal length.
    """

    diameter_mm: float
    distance_mm: float

    def __post_init__(self) -> None:
        """Refuse what is no hole.

        Raises:
            ContractError: If a length is not > 0.
        """
        if not (0 < self.diameter_mm < math.inf and 0 < self.distance_mm < math.inf):
            raise ContractError(
                "a pinhole needs a diameter and a distance > 0 mm; got "
                f"{self.diameter_mm}, {self.distance_mm}"
            )

    @property
    def name(self) -> str:
        """Name it by its diameter."""
        return f"pinhole-{self.diameter_mm:g}"

    @property
    def facts(self) -> Mapping[str, float]:
        """The focal length."""
        return {"efl_mm": self.distance_mm}

    @property
    def depths_mm(self) -> tuple[float, ...]:
        """Infinity."""
        return (math.inf,)

    @property
    def focus_mm(self) -> float:
        """Infinity; it focuses on nothing."""
        return math.inf

    @property
    def reference_wavelength_um(self) -> float:
        """Green."""
        return REFERENCE_UM

    @property
    def wavelengths_um(self) -> FloatGrid:
        """The wavelengths of visible light."""
        return np.array(WAVELENGTHS_UM)

    def layout(self, corner_mm: float, fields: int) -> FieldLayout:
        """Return heights from the axis to the corner, evenly spaced."""
        return radial_layout(np.linspace(0.0, corner_mm, fields))

    def kernels(
        self,
        fields: FieldLayout,
        wavelengths_um: FloatGrid,
        *,
        depth_mm: float,
        side_px: int,
        pitch_um: float,
    ) -> TracedPsf:
        """Return the kernels at heights along +y.

        Raises:
            ContractError: If the light is too wide for the grid of the wave.
        """
        frames = [
            [
                self._light(float(height), float(wave), depth_mm, side_px, to_mm(pitch_um))
                for wave in wavelengths_um
            ]
            for height in fields.y_mm
        ]
        light = np.array(frames)
        energy = light.sum(axis=(-2, -1))
        return TracedPsf(
            kernels=torch.from_numpy(light / energy[..., None, None]),
            energy_kept=torch.from_numpy(np.minimum(energy, 1.0)),
        )

    def distortion(self, radius_mm: float, channels: int) -> RadialDistortion:
        """Return none: a hole draws in true perspective."""
        straight = np.tile(np.array([[1.0, 0.0, 0.0, 0.0]]), (channels, 1))
        return RadialDistortion(coefficients=straight, radius_mm=radius_mm)

    def illumination(self, fields: FieldLayout) -> FloatGrid:
        """Return cos^4 of the field angle."""
        return np.asarray(np.cos(np.arctan(fields.heights_mm / self.distance_mm)) ** 4)

    def copies(self, count: int, seed: int) -> "tuple[Pinhole, ...]":
        """Return itself alone."""
        del count, seed
        return (self,)

    def _light(
        self, height_mm: float, wave_um: float, depth_mm: float, side_px: int, pitch_mm: float
    ) -> NDArray[np.float64]:
        """Return the light by pixel (n, n) about the chief ray, of 1 that comes through the hole.

        Over the hole the path to a place of the sensor is quadratic: its curvature is cos(a) over
        the distance across the meridian and cos^3(a) along it; light of a near point diverges.
        """
        cos = math.cos(math.atan(height_mm / self.distance_mm))
        wave_mm = to_mm(wave_um)
        # the light has no detail finer than this
        finest_mm = wave_mm * self.distance_mm / self.diameter_mm
        finer = 2 ** max(0, math.ceil(math.log2(2 * pitch_mm / finest_mm)))
        step = pitch_mm / finer
        size = self._side(max(side_px * pitch_mm, self.diameter_mm), finest_mm, step)
        # light of a near point, seen as a plane wave behind a longer way (Fresnel scaling)
        stretch = 1.0 if math.isinf(depth_mm) else 1 + self.distance_mm / depth_mm
        way_mm = self.distance_mm / stretch
        wave = _hole(self.diameter_mm / 2, step / stretch, size)
        spectrum = scipy.fft.fft2(wave)
        frequency = np.fft.fftfreq(size, step / stretch)
        phase = np.pi * wave_mm * way_mm * frequency**2
        spectrum *= np.exp(-1j * phase / cos**3)[:, None] * np.exp(-1j * phase / cos)
        field = np.abs(scipy.fft.ifft2(spectrum)) ** 2
        # a pixel sees the mean over its area, the chief ray in the middle of one
        pixel = np.sinc(np.fft.fftfreq(size) * finer)
        light = scipy.fft.ifft2(scipy.fft.fft2(field) * pixel[:, None] * pixel).real
        light = np.fft.fftshift(light)[::finer, ::finer] * finer**2
        middle, reach = light.shape[0] // 2, side_px // 2
        cut = slice(middle - reach, middle + reach + 1)
        return np.asarray(np.maximum(light[cut, cut], 0) / (np.abs(wave) ** 2).sum(), np.float64)

    def _side(self, wanted_mm: float, finest_mm: float, step_mm: float) -> int:
        """Return the side of a grid on which the waves do not wrap into the kernel."""
        least = (wanted_mm + 2 * self.diameter_mm + 16 * finest_mm) / step_mm
        size = 1 << math.ceil(math.log2(max(least, 64)))
        if size > MOST_SIDE:
            raise ContractError(
                f"light of {self.name} at {self.distance_mm:g} mm is too wide for its samples of "
                f"{1000 * step_mm:g} um; use another hole"
            )
        return size


def _hole(radius_mm: float, step_mm: float, size: int) -> NDArray[np.complex128]:
    """Return the wave in the hole, the middle at [0, 0]; samples at its rim hold their share."""
    reach = math.ceil(radius_mm / step_mm) + 1
    part = (np.arange((2 * reach + 1) * _EDGE_PARTS) + 0.5) / _EDGE_PARTS - reach - 0.5
    inside = np.hypot(part[:, None], part) * step_mm <= radius_mm
    side = 2 * reach + 1
    shares = inside.reshape(side, _EDGE_PARTS, side, _EDGE_PARTS).mean(axis=(1, 3))
    wave = np.zeros((size, size), np.complex128)
    wave[:side, :side] = shares
    return np.roll(wave, (-reach, -reach), axis=(0, 1))

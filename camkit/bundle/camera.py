"""The sensor of a camera as its bundle states it: size, levels, noise per ISO, colour."""

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from camkit.contracts import CfaPattern, NoiseModel
from camkit.errors import ContractError

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Row = tuple[float, float, float]


class Entry(BaseModel):
    """What every part of the manifest has in common: unknown fields, NaN and inf are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class IsoNoise(Entry):
    """Gain and read noise measured at one ISO.

    Attributes:
        gain_e_per_dn: Electrons per digital number.
        read_noise_e: Standard deviation at zero signal, in electrons.
    """

    iso: Positive
    gain_e_per_dn: Positive
    read_noise_e: NonNegative


class ChannelResponse(Entry):
    """Relative response of the colour channels over wavelength.

    Attributes:
        wavelengths_um: (n,), increasing.
        response: (3, n), rows R, G, B.
        source: Where the numbers come from.
    """

    wavelengths_um: tuple[Positive, ...]
    response: tuple[
        tuple[NonNegative, ...],
        tuple[NonNegative, ...],
        tuple[NonNegative, ...],
    ]
    source: str

    @model_validator(mode="after")
    def _check(self) -> "ChannelResponse":
        n = len(self.wavelengths_um)
        if n == 0 or (np.diff(self.wavelengths_um) <= 0).any():
            raise ValueError("wavelengths_um must be at least one, increasing")
        if any(len(row) != n or sum(row) <= 0 for row in self.response):
            raise ValueError(f"response needs {n} values per colour, not all zero")
        return self

    def to_arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the wavelengths (n,) in micrometres and the response (3, n)."""
        return np.array(self.wavelengths_um), np.array(self.response)


class Camera(Entry):
    """Sensor and colour of the camera.

    Attributes:
        width_px: Columns of the whole sensor.
        height_px: Rows of the whole sensor.
        pixel_pitch_um: Distance of neighbouring pixels.
        cfa: Mosaic in reading order of the cell at pixel (0, 0), None without a mosaic.
        black_level: DN at no light.
        white_level: DN at which the signal clips; black_level .. white_level becomes 0 .. 1.
        full_well_e: Electrons at the white level of the lowest ISO.
        noise: Gain and read noise, by increasing ISO.
        channel_response: Response of the colours over wavelength.
        color_matrix: (3, 3), CIE XYZ under `illuminant` -> camera, as DNG's ColorMatrix.
        illuminant: The illuminant of the colour matrix.
    """

    width_px: Annotated[int, Field(gt=0, le=100_000)]
    height_px: Annotated[int, Field(gt=0, le=100_000)]
    pixel_pitch_um: Positive
    cfa: CfaPattern | None
    black_level: NonNegative
    white_level: Positive
    full_well_e: Positive
    noise: tuple[IsoNoise, ...]
    channel_response: ChannelResponse
    color_matrix: tuple[Row, Row, Row]
    illuminant: Literal["D65"] = "D65"

    @model_validator(mode="after")
    def _check(self) -> "Camera":
        if self.white_level <= self.black_level:
            raise ValueError(
                f"white_level {self.white_level} must lie above black_level {self.black_level}"
            )
        isos = [entry.iso for entry in self.noise]
        if not isos or (np.diff(isos) <= 0).any():
            raise ValueError(f"noise needs at least one ISO, increasing; got {isos}")
        if abs(np.linalg.det(np.array(self.color_matrix))) < 1e-9:
            raise ValueError("color_matrix cannot be inverted")
        return self

    def noise_at(self, iso: float) -> NoiseModel:
        """Give the noise of the linear signal (1.0 = white level) at one ISO.

        Between the stated ISOs, gain and read noise are interpolated over log ISO (the gain as
        its logarithm). Above them the gain goes on as 1/ISO and the read noise in electrons
        stays. Below them both stay: at the lowest ISO a full pixel is at the white level, so a
        camera that offers less only exposes longer.

        Args:
            iso: ISO speed, > 0.

        Returns:
            shot = 1 / (gain * (white - black)) and read_variance = (read_noise * shot)^2, the
            same for the three colours.

        Raises:
            ContractError: If the ISO is not a positive number.
        """
        if not (math.isfinite(iso) and iso > 0):
            raise ContractError(f"iso must be a number > 0; got {iso}")
        known = np.log([entry.iso for entry in self.noise])
        gains = np.log([entry.gain_e_per_dn for entry in self.noise])
        reads = [entry.read_noise_e for entry in self.noise]
        wanted = math.log(iso)
        inside = min(max(wanted, known[0]), known[-1])
        above = max(wanted - known[-1], 0.0)
        gain = math.exp(float(np.interp(inside, known, gains)) - above)
        shot = 1 / (gain * (self.white_level - self.black_level))
        read_variance = (float(np.interp(inside, known, reads)) * shot) ** 2
        return NoiseModel(shot=(shot,) * 3, read_variance=(read_variance,) * 3)

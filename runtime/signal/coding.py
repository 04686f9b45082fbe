"""Light in the numbers of a network of somebody else, and back.

    light -> exposure -> matrix -> curve of sRGB -> gain, offset    what it takes
    light <- exposure <- matrix <- curve of sRGB <- gain, offset    what it gives

Sums and powers are taken in float64 sample by sample, so no cut into rows changes a bit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages.foreign.coding import Numbers, Space
from camkit.colorimetry import Matrix
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.machine.slices import run_chunks
from camkit.runtime.rows import PiecedRows

_LINEAR_END: Final = 0.0031308
_CURVE_END: Final = 0.04045
_SLOPE: Final = 12.92
_COLOURS: Final = 3
Doubles = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneCoding:
    """The numbers of one plane.

    Attributes:
        space: camera, rec709 or srgb.
        matrix: (3, 3) from the planes to linear Rec.709; of no use in the space camera, or for
            other numbers of channels.
        exposure: Factor on the light.
        gain: One number, or one for each channel.
        offset: Likewise.
    """

    space: Space
    matrix: Matrix
    exposure: float
    gain: Numbers
    offset: Numbers

    def encode(self, light: FloatArray, out: FloatArray) -> None:
        """Fill `out` with the numbers of (c, h, w) light."""
        values: Doubles = light.astype(np.float64) * self.exposure
        values = self._turned(values, self.matrix)
        if self.space == "srgb":
            values = srgb_curve(values)
        out[...] = values * _column(self.gain) + _column(self.offset)

    def decode(self, values: FloatArray) -> None:
        """Convert (c, h, w) numbers to light, in place."""
        light = (values.astype(np.float64) - _column(self.offset)) / _column(self.gain)
        if self.space == "srgb":
            light = linear_of_srgb(light)
        light = self._turned(light, np.asarray(np.linalg.inv(self.matrix), np.float64))
        values[...] = light / self.exposure

    def deviation(self, light: FloatArray, noise: NoiseModel) -> FloatArray:
        """Return (1, h, w): the standard deviation of the noise in these numbers.

        Args:
            light: (c, h, w) float32.
            noise: Of its channels; light below black counts as black.
        """
        shot, read = (np.array(part)[:, None, None] for part in (noise.shot, noise.read_variance))
        variance = np.maximum(light.astype(np.float64), 0) * shot + read
        variance *= self.exposure**2
        if self.space != "camera":
            variance = self._turned(variance, np.square(self.matrix))
        if self.space == "srgb":
            turned = self._turned(light.astype(np.float64) * self.exposure, self.matrix)
            variance *= srgb_slope(turned) ** 2
        variance *= _column(self.gain) ** 2
        total = sum(variance[1:], start=variance[0]) / variance.shape[0]
        return np.asarray(np.sqrt(total)[None], np.float32)

    def largest_light(self, largest: float) -> float:
        """Return the most light that a number of at most this size may stand for."""
        gain, offset = (np.abs(np.array(numbers)) for numbers in (self.gain, self.offset))
        value = (largest + float(offset.max())) / float(gain.min())
        return float(linear_of_srgb(np.array(value))) if self.space == "srgb" else value

    def largest_number(self, light: float) -> float:
        """Return the largest size of the numbers of so much light."""
        gain, offset = (np.abs(np.array(numbers)) for numbers in (self.gain, self.offset))
        value = float(srgb_curve(np.array(light))) if self.space == "srgb" else light
        return value * float(gain.max()) + float(offset.max())

    def _turned(self, values: Doubles, matrix: Matrix) -> Doubles:
        """Multiply three colours by a matrix, term by term."""
        if self.space == "camera" or values.shape[0] != _COLOURS:
            return values
        red, green, blue = values
        return np.stack([row[0] * red + row[1] * green + row[2] * blue for row in matrix])


def srgb_curve(light: Doubles) -> Doubles:
    """Return sRGB of linear light; the line goes on below 0, the power beyond 1.

    References: IEC 61966-2-1.
    """
    power = 1.055 * np.maximum(light, _LINEAR_END) ** (1 / 2.4) - 0.055
    return np.where(light <= _LINEAR_END, _SLOPE * light, power)


def linear_of_srgb(values: Doubles) -> Doubles:
    """Return the light of sRGB, the inverse of `srgb_curve`."""
    power = ((np.maximum(values, _CURVE_END) + 0.055) / 1.055) ** 2.4
    return np.where(values <= _CURVE_END, values / _SLOPE, power)


def srgb_slope(light: Doubles) -> Doubles:
    """Return the derivative of `srgb_curve`."""
    power = 1.055 / 2.4 * np.maximum(light, _LINEAR_END) ** (1 / 2.4 - 1)
    return np.where(light <= _LINEAR_END, _SLOPE, power)


def _column(numbers: Numbers) -> Doubles:
    return np.array(numbers, np.float64)[:, None, None]


class CodedRows:
    """The input of a network of somebody else: coded planes, a map of the noise behind them."""

    def __init__(
        self,
        sources: Sequence[PiecedRows],
        coding: PlaneCoding,
        *,
        noise: NoiseModel | None = None,
        threads: int = 1,
    ) -> None:
        """Store the sources.

        Args:
            sources: (c, h, w) each, of one size.
            coding: Of all of them.
            noise: Of the last one, for a map of it; None for no map.
            threads: Threads that share the rows of one read; no influence on the bits.

        Raises:
            ContractError: If the sources differ in size.
        """
        sizes = [source.shape[1:] for source in sources]
        if len(set(sizes)) != 1:
            raise ContractError(f"the planes of a network must have one size; got {sizes}")
        self._sources, self._coding = tuple(sources), coding
        self._noise, self._threads = noise, threads

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (c, h, w) of all planes together."""
        _, height, width = self._sources[0].shape
        channels = sum(source.shape[0] for source in self._sources)
        return channels + (self._noise is not None), height, width

    def read(self, top: int, bottom: int) -> FloatArray:
        """Return the rows top..bottom, (c, rows, w)."""
        stacked = np.empty((self.shape[0], bottom - top, self.shape[2]), np.float32)
        start = 0
        for source in self._sources:
            end = start + source.shape[0]
            self._fill(stacked, source.read(top, bottom), start)
            start = end
        return stacked

    def _fill(self, stacked: FloatArray, light: FloatArray, start: int) -> None:
        end = start + light.shape[0]
        noise = self._noise if end + 1 == stacked.shape[0] else None

        def work(first: int, last: int) -> None:
            rows = np.s_[:, first:last]
            self._coding.encode(light[rows], stacked[start:end, first:last])
            if noise is not None:
                stacked[end:, first:last] = self._coding.deviation(light[rows], noise)

        run_chunks(work, light.shape[1], light.shape[2], threads=self._threads)

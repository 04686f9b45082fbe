"""The sensor of a camera as its bundle states it: what it gives, size, levels, noise, colour.

    Sensor = BayerSensor    a colour mosaic
           | PlanesSensor   any number of full planes: monochrome, three shots, linear pictures
           | SpadSensor     photons counted, by arrival time if it has bins

The inputs that a bundle takes follow from its sensor.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from camkit.arrays import InputContract
from camkit.bundle.entry import Entry, NonNegative, Positive
from camkit.bundle.plane import Axes, Plane
from camkit.cfa import CfaPattern
from camkit.errors import ContractError, UnsupportedError
from camkit.noise import NoiseModel

RGB: Final = ("R", "G", "B")
GREY: Final = ("Y",)
MOSAIC: Final = ("cfa",)
Side = Annotated[int, Field(gt=0, le=100_000)]
Row = tuple[float, float, float]


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
    """Relative response of the channels over wavelength.

    Attributes:
        wavelengths_um: (n,), increasing.
        response: (channel, n), rows in the order of the sensor's channels.
        source: Where the numbers come from.
    """

    wavelengths_um: tuple[Positive, ...]
    response: tuple[tuple[NonNegative, ...], ...]
    source: str

    @model_validator(mode="after")
    def _check(self) -> "ChannelResponse":
        n = len(self.wavelengths_um)
        if n == 0 or (np.diff(self.wavelengths_um) <= 0).any():
            raise ValueError("wavelengths_um must be at least one, increasing")
        if not self.response or any(len(row) != n or sum(row) <= 0 for row in self.response):
            raise ValueError(f"response needs {n} values per colour, not all zero")
        return self

    def to_arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the wavelengths (n,) in micrometres and the response (channel, n)."""
        return np.array(self.wavelengths_um), np.array(self.response)


class Extent(Entry):
    """The size of a sensor, and where the optical axis meets it.

    Attributes:
        width_px: Columns of the whole sensor.
        height_px: Rows of the whole sensor.
        pixel_pitch_um: Distance of neighbouring pixels.
        optical_centre_px: (x, y) of the optical axis; None for the middle of the sensor.
    """

    width_px: Side
    height_px: Side
    pixel_pitch_um: Positive
    optical_centre_px: tuple[float, float] | None = None

    @property
    def axis_px(self) -> tuple[float, float]:
        """Return (x, y) of the optical axis, that of the middle where nothing else is stated."""
        return self.optical_centre_px or ((self.width_px - 1) / 2, (self.height_px - 1) / 2)


class PixelSensor(Entry):
    """The base class of all sensors.

    Attributes:
        extent: Size and pitch; None for a camera that takes pictures of any size.
    """

    extent: Extent | None = None

    @property
    def known_extent(self) -> Extent:
        """Return the extent.

        Raises:
            UnsupportedError: If pictures of any size are taken.
        """
        if self.extent is None:
            raise UnsupportedError(
                "this camera takes pictures of any size and states no sensor; "
                "what was asked for needs one"
            )
        return self.extent

    @property
    def width_px(self) -> int:
        """Return the columns of the whole sensor."""
        return self.known_extent.width_px

    @property
    def height_px(self) -> int:
        """Return the rows of the whole sensor."""
        return self.known_extent.height_px

    @property
    def pixel_pitch_um(self) -> float:
        """Return the distance of neighbouring pixels."""
        return self.known_extent.pixel_pitch_um


class LightSensor(PixelSensor):
    """The base class of sensors that integrate light.

    Attributes:
        black_level: DN at no light.
        white_level: DN at which the signal clips; black_level .. white_level becomes 0 .. 1.
        full_well_e: Electrons at the white level of the lowest ISO.
        noise: Gain and read noise, by increasing ISO.
        channel_response: Response of the channels over wavelength; None if not known.
    """

    black_level: NonNegative
    white_level: Positive
    full_well_e: Positive
    noise: tuple[IsoNoise, ...]
    channel_response: ChannelResponse | None = None

    @model_validator(mode="after")
    def _check_signal(self) -> "LightSensor":
        if self.white_level <= self.black_level:
            raise ValueError(
                f"white_level {self.white_level} must lie above black_level {self.black_level}"
            )
        isos = [entry.iso for entry in self.noise]
        if not isos or (np.diff(isos) <= 0).any():
            raise ValueError(f"noise needs at least one ISO, increasing; got {isos}")
        return self

    def response_arrays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the wavelengths (n,) in micrometres and the response (channel, n).

        Raises:
            UnsupportedError: If the response is not known.
        """
        if self.channel_response is None:
            raise UnsupportedError("this sensor states no channel_response; kernels need one")
        return self.channel_response.to_arrays()

    def one_noise_at(self, iso: float) -> tuple[float, float]:
        """Return shot noise and read variance of the linear signal (1.0 = white level) at one ISO.

        Between the stated ISOs, gain and read noise are interpolated over log ISO (the gain as
        its logarithm). Above them the gain goes on as 1/ISO and the read noise in electrons
        stays. Below them both stay: at the lowest ISO a full pixel is at the white level, so a
        camera that offers less only exposes longer.

        Args:
            iso: ISO speed, > 0.

        Returns:
            shot = 1 / (gain * (white - black)) and read_variance = (read_noise * shot)^2.

        Raises:
            ContractError: If the ISO is not a positive number.
        """
        if not (math.isfinite(iso) and iso > 0):
            raise ContractError(f"iso must be a number > 0; got {iso}")
        log_isos = np.log([entry.iso for entry in self.noise])
        gains = np.log([entry.gain_e_per_dn for entry in self.noise])
        reads = [entry.read_noise_e for entry in self.noise]
        log_iso = math.log(iso)
        inside = min(max(log_iso, log_isos[0]), log_isos[-1])
        excess = max(log_iso - log_isos[-1], 0.0)
        gain = math.exp(float(np.interp(inside, log_isos, gains)) - excess)
        shot = 1 / (gain * (self.white_level - self.black_level))
        return shot, (float(np.interp(inside, log_isos, reads)) * shot) ** 2


def _check_matrix(matrix: tuple[Row, Row, Row]) -> None:
    if abs(np.linalg.det(np.array(matrix))) < 1e-9:
        raise ValueError("color_matrix cannot be inverted")


def _check_response(response: ChannelResponse | None, channels: tuple[str, ...]) -> None:
    if response is not None and len(response.response) != len(channels):
        raise ValueError(
            f"channel_response needs one row for each of {', '.join(channels)}; "
            f"got {len(response.response)}"
        )


class BayerSensor(LightSensor):
    """A sensor behind a mosaic of red, green and blue.

    Attributes:
        cfa: Mosaic in reading order of the cell at pixel (0, 0).
        color_matrix: (3, 3), CIE XYZ under `illuminant` -> camera, as DNG's ColorMatrix.
        illuminant: The illuminant of the colour matrix.
    """

    type: Literal["bayer"] = "bayer"
    cfa: CfaPattern
    color_matrix: tuple[Row, Row, Row]
    illuminant: Literal["D65"] = "D65"

    @model_validator(mode="after")
    def _check(self) -> "BayerSensor":
        _check_matrix(self.color_matrix)
        _check_response(self.channel_response, RGB)
        return self

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the colours."""
        return RGB

    @property
    def captured(self) -> tuple[str, ...]:
        """Names of the channels of a capture: one mosaic."""
        return MOSAIC

    @property
    def plane(self) -> Plane:
        """The plane that the sensor gives: digital numbers."""
        return Plane(type="uint16", channels=self.captured, domain="dn")

    @property
    def text(self) -> str:
        """Its colours and full well, in words."""
        return f"{self.cfa}, full well {self.full_well_e:g} e-"

    @property
    def inputs(self) -> tuple[InputContract, ...]:
        """Names of the inputs that are taken, the sensor's own first."""
        return ("raw_bayer_v1", "linear_rgb_v1")

    def noise_at(self, iso: float) -> NoiseModel:
        """Return the noise of the linear signal at one ISO, the same for the three colours.

        Raises:
            ContractError: If the ISO is not a positive number.
        """
        shot, read_variance = self.one_noise_at(iso)
        return NoiseModel(shot=(shot,) * 3, read_variance=(read_variance,) * 3)


class PlanesSensor(LightSensor):
    """A sensor that gives every channel at every pixel.

    Attributes:
        channels: Their names; ("R", "G", "B") for colour, ("Y",) for a monochrome camera.
        color_matrix: As that of a Bayer sensor, for three channels; None for channels that are
            linear Rec.709 already, or grey.
        illuminant: The illuminant of the colour matrix.
    """

    type: Literal["planes"] = "planes"
    channels: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9_]{1,16}$")], ...],
        Field(min_length=1, max_length=256),
    ] = RGB
    color_matrix: tuple[Row, Row, Row] | None = None
    illuminant: Literal["D65"] = "D65"

    @model_validator(mode="after")
    def _check(self) -> "PlanesSensor":
        if len(set(self.channels)) != len(self.channels) or set(self.channels) & set(MOSAIC):
            raise ValueError(f"channels must have different names; got {', '.join(self.channels)}")
        if self.color_matrix is not None:
            if len(self.channels) != len(RGB):
                raise ValueError("a color_matrix needs three channels")
            _check_matrix(self.color_matrix)
        _check_response(self.channel_response, self.channels)
        return self

    @property
    def cfa(self) -> None:
        """None: there is no mosaic."""
        return

    @property
    def captured(self) -> tuple[str, ...]:
        """Names of the channels of a capture."""
        return self.channels

    @property
    def plane(self) -> Plane:
        """The plane that the sensor gives: digital numbers."""
        return Plane(type="uint16", channels=self.captured, domain="dn")

    @property
    def text(self) -> str:
        """Its colours and full well, in words."""
        return f"{', '.join(self.channels)}, full well {self.full_well_e:g} e-"

    @property
    def inputs(self) -> tuple[InputContract, ...]:
        """Names of the inputs that are taken."""
        return ("linear_rgb_v1" if len(self.channels) == len(RGB) else "linear_planes_v1",)

    def noise_at(self, iso: float) -> NoiseModel:
        """Return the noise of the linear signal at one ISO, the same for all channels.

        Raises:
            ContractError: If the ISO is not a positive number.
        """
        shot, read_variance = self.one_noise_at(iso)
        count = len(self.channels)
        return NoiseModel(shot=(shot,) * count, read_variance=(read_variance,) * count)


class SpadSensor(PixelSensor):
    """An array of single-photon avalanche diodes.

    Attributes:
        time_bins: Bins of a histogram; 0 for an array that only counts.
        time_bin_ps: Width of a bin.
        dead_time_ps: Time for which a diode is blind after a photon; simulated pictures lose counts
            to it.
        dark_count_rate_hz: Counts per second and pixel without light.
        fill_factor: Share of a pixel that sees light.
        detection_efficiency: Share of the photons there that are counted (format 2.3); a stated
            fact, since photons are those counted wherever a number of them is given.
        sub_pixels: Along a side of a pixel, of the grid on which pictures are made (format 2.3).
        phase: Sub-pixel, along either axis, at which a pixel sees (format 2.3).
    """

    type: Literal["spad"] = "spad"
    time_bins: Annotated[int, Field(ge=0, le=65_536)] = 0
    time_bin_ps: Positive | None = None
    dead_time_ps: NonNegative = 0.0
    dark_count_rate_hz: NonNegative = 0.0
    fill_factor: Annotated[float, Field(gt=0, le=1)] = 1.0
    detection_efficiency: Annotated[float, Field(gt=0, le=1)] = 1.0
    sub_pixels: Annotated[int, Field(ge=1, le=16)] = 1
    phase: Annotated[int, Field(ge=0, lt=16)] = 0

    channel_response: ClassVar[None] = None

    @model_validator(mode="after")
    def _check(self) -> "SpadSensor":
        if self.phase >= self.sub_pixels:
            raise ValueError(f"phase must be one of the sub-pixels 0..{self.sub_pixels - 1}")
        if self.time_bins and self.time_bin_ps is None:
            raise ValueError("time_bins need their width, time_bin_ps")
        return self

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels: photons."""
        return ("photons",)

    @property
    def captured(self) -> tuple[str, ...]:
        """Names of the channels of a capture."""
        return self.channels

    @property
    def plane(self) -> Plane:
        """The plane that the sensor gives: photons, by time if it has bins."""
        axes: Axes = "t y x" if self.time_bins else "y x"
        return Plane(axes=axes, type="uint32", channels=self.captured, domain="counts")

    @property
    def text(self) -> str:
        """Its way of seeing, in words."""
        return "counting photons"

    @property
    def inputs(self) -> tuple[InputContract, ...]:
        """Names of the inputs that are taken."""
        return ("spad_counts_v1", "spad_histogram_v1") if self.time_bins else ("spad_counts_v1",)


ColorSensor = BayerSensor | PlanesSensor
Sensor = Annotated[BayerSensor | PlanesSensor | SpadSensor, Field(discriminator="type")]

_EXTENT: Final = ("width_px", "height_px", "pixel_pitch_um", "optical_centre_px")


def nested_sensor(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a sensor of a flat table, as recipes and manifests of format 1.0 hold it.

    Its size stands beside the rest, and a `cfa` (or none) tells what it is unless it has a type.

    Raises:
        ContractError: If it states its size in both ways.
    """
    extent = {name: table[name] for name in _EXTENT if name in table}
    rest = {name: value for name, value in table.items() if name not in _EXTENT}
    if "type" not in rest:
        rest["type"] = "planes" if rest.get("cfa") is None else "bayer"
    if rest["type"] != "bayer" and rest.get("cfa") is None:
        rest.pop("cfa", None)
    if extent and rest.get("extent") is not None:
        raise ContractError(f"extent and {', '.join(extent)} say the same: give one of them")
    return {**rest, "extent": extent} if extent else rest

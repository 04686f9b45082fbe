"""Readers of the TOML that `camkit calibrate` writes: geometry, flat, noise.

That of a tone curve is read by `camkit.runtime.signal.tone_curve`.
"""

from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field, ValidationError, model_validator

from camkit.bundle.entry import Entry, NonNegative, Positive
from camkit.bundle.optics import IlluminationEntry
from camkit.bundle.sensor import IsoNoise
from camkit.calibration.geometry.unfolded import MOST_FACTOR
from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_toml

Side = Annotated[int, Field(ge=2, le=100_000)]
Place = Annotated[float, Field(ge=-1e6, le=1e6)]
Factor = Annotated[float, Field(ge=-MOST_FACTOR, le=MOST_FACTOR)]
_T = TypeVar("_T", bound=Entry)


class RadialRecord(Entry, extra="ignore"):
    """The polynomial by which bundles are distorted; see `RadialFit`."""

    coefficients: tuple[Factor, Factor, Factor, Factor]
    radius_px: Positive
    residual_px: NonNegative


class GeometryFile(Entry, extra="ignore"):
    """A result of `camkit calibrate geometry`, as far as bundles and pairs take it."""

    width_px: Side
    height_px: Side
    model: str
    focal_px: Positive | None = None
    centre_px: tuple[Place, Place]
    coefficients: Annotated[tuple[Factor, ...], Field(max_length=8)] | None = None
    covered_radius_px: Positive
    radial: RadialRecord


class FlatFile(Entry, extra="ignore"):
    """A result of `camkit calibrate flat`, as far as bundles and pairs take it.

    Attributes:
        width_px: Of the sensor; None in files from before it was stated.
        height_px: Likewise.
    """

    heights_mm: tuple[NonNegative, ...]
    relative_illumination: tuple[Positive, ...]
    pixel_pitch_um: Positive
    width_px: Side | None = None
    height_px: Side | None = None
    centre_px: tuple[Place, Place]
    centre_found: bool
    separated: bool

    @model_validator(mode="after")
    def _check(self) -> "FlatFile":
        self.to_entry()
        return self

    def to_entry(self) -> IlluminationEntry:
        """Return it as an entry of a lens profile."""
        return IlluminationEntry(
            heights_mm=self.heights_mm, relative_illumination=self.relative_illumination
        )


class IsoRecord(Entry, extra="ignore"):
    """The measured values at one ISO."""

    iso: Positive
    gain_e_per_dn: Positive
    read_noise_e: NonNegative
    read_noise_resolved: bool
    full_well_e: Positive
    black_level: NonNegative
    white_level: Positive


class NoiseFile(Entry, extra="ignore"):
    """A result of `camkit calibrate noise`, as far as bundles take it."""

    iso: Annotated[tuple[IsoRecord, ...], Field(min_length=1, max_length=256)]

    @model_validator(mode="after")
    def _check(self) -> "NoiseFile":
        if len({one.iso for one in self.iso}) < len(self.iso):
            raise ValueError("an ISO is stated twice")
        for one in self.iso:
            if one.white_level <= one.black_level:
                raise ValueError(
                    f"ISO {one.iso:g} has its white level {one.white_level:g} not above its black "
                    f"level {one.black_level:g}"
                )
        return self

    def noise(self) -> tuple[IsoNoise, ...]:
        """Return gain and read noise by increasing ISO."""
        return tuple(
            IsoNoise(iso=one.iso, gain_e_per_dn=one.gain_e_per_dn, read_noise_e=one.read_noise_e)
            for one in sorted(self.iso, key=lambda one: one.iso)
        )


def read_geometry(path: Path) -> GeometryFile:
    """Read a result of `camkit calibrate geometry`.

    Raises:
        DecodeError: If it cannot be read or is something else.
    """
    return _read(path, GeometryFile, "geometry")


def read_flat(path: Path) -> FlatFile:
    """Read a result of `camkit calibrate flat`; see `read_geometry`."""
    return _read(path, FlatFile, "flat")


def read_noise(path: Path) -> NoiseFile:
    """Read a result of `camkit calibrate noise`; see `read_geometry`."""
    return _read(path, NoiseFile, "noise")


def _read(path: Path, model: type[_T], command: str) -> _T:
    record = _toml(path)
    try:
        return model.model_validate(record)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise DecodeError(
            f"{path} is not what `camkit calibrate {command}` writes: {where}: {first['msg']}"
        ) from error


def _toml(path: Path) -> dict[str, Any]:
    try:
        return read_side_toml(path, "the measured file")
    except ContractError as error:
        raise DecodeError(str(error)) from error

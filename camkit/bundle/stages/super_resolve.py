"""Photons of an array behind a plate on a finer grid: linearly, or by a network."""

from collections.abc import Sequence
from typing import Annotated, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from camkit.bundle.entry import Positive, Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages.entry import (
    BOUNDED,
    JoinError,
    Parts,
    StageEntry,
    need_counts_of_pixels,
)

PORTS = (1, 1)
"""Channels of a network: light, and what is told of its noise."""
NOISE_SCALE: Final = 3.0
"""Deviations in the plane that tells a network of noise."""
WHITE_PERCENTILE: Final = 99.5
"""Of the photons of a picture that are taken for white where nobody says."""
LEAST_WHITE: Final = 4.0
"""Photons: below, chance alone makes the brightest pixel."""
SURE: Final = 2.0
"""Standard deviations below what a pixel counted: so much light was there for sure."""
Sampled = Literal["plate", "low_fill", "full_fill", "gaussian"]


class SuperResolve(StageEntry):
    """Every pixel becomes the sub-pixels that its sensor names (format 2.3).

    What a linear estimate takes for granted of pictures is their covariance
    C(d) = contrast^2 mean^2 exp(-(d / reach)^exponent) at a distance d.

    Attributes:
        role: Key of `networks` in the manifest.
        contrast: Standard deviation of light over its mean.
        reach: Distance in sub-pixels at which the covariance has fallen to 1 / e.
        exponent: How it falls.
        network_from_photons: Signal photons of a pixel, on average, from which on depth is read
            behind the network; below, the linear estimate is nearer to the truth.
        sampling: What its pixels see through: the plate of the optics; nothing (low_fill); all
            sub-pixels of a pixel at once (full_fill); a Gaussian diffuser.
        sigma: Of a Gaussian, in sub-pixels; of it alone.
        floor: A sub-pixel of a picture has at least this share of what the darkest of the 3x3
            pixels around it counted for sure (format 2.8); 0 for none, as before.
    """

    runtime: ClassVar[str] = "camkit.runtime.kinds.spad.stages.super_resolve"
    type: Literal["super_resolve"] = "super_resolve"
    takes: tuple[Word, ...] = ("photons",)
    gives: tuple[Word, ...] = ("fine",)
    role: Word = "upscale"
    contrast: Positive = 0.634
    reach: Positive = 129.0
    exponent: Annotated[float, Field(gt=0, le=2)] = 0.52
    network_from_photons: Positive = 80.0
    sampling: Sampled = "plate"
    sigma: Positive | None = None
    floor: Annotated[float, Field(ge=0, le=1), BOUNDED] = 0.0

    @model_validator(mode="after")
    def _check_sigma(self) -> Self:
        if (self.sigma is not None) != (self.sampling == "gaussian"):
            raise ValueError("sigma belongs to the sampling gaussian, and to it alone")
        return self

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the photons on the fine grid."""
        plane = need_counts_of_pixels(planes)
        sensor, optics = parts.sensor, parts.need_optics("it undoes their blur")
        if not isinstance(sensor, SpadSensor) or sensor.sub_pixels < 2:
            raise JoinError("it takes an array that counts photons and states its sub_pixels")
        if optics.type != "frozen_psf" or optics.symmetry != "uniform":
            raise JoinError("it takes one kernel for the whole array: symmetry uniform")
        pitch_um = sensor.pixel_pitch_um / sensor.sub_pixels
        if abs(optics.pixel_pitch_um - pitch_um) > 1e-6 * pitch_um:
            raise JoinError(
                f"its kernel must have samples of {pitch_um:g} um, one for each sub-pixel; got "
                f"{optics.pixel_pitch_um:g}"
            )
        for size, facts in parts.networks.get(self.role, {}).items():
            ports = tuple(port.channels for port in facts.inputs)
            if ports != PORTS or [port.channels for port in facts.outputs] != [1]:
                raise JoinError(f"its network of size {size} must take light and noise, give light")
            if facts.output_scale != sensor.sub_pixels:
                raise JoinError(
                    f"its network of size {size} makes {facts.output_scale} samples of a pixel, "
                    f"the sensor has {sensor.sub_pixels} sub-pixels"
                )
        share = 1 / sensor.sub_pixels
        x, y = plane.grid.origin_px
        shift = sensor.phase * plane.grid.pitch_ratio * share
        grid = plane.grid.model_copy(
            update={
                "pitch_ratio": plane.grid.pitch_ratio * share,
                "origin_px": (x - shift, y - shift),
            }
        )
        return (plane.model_copy(update={"type": "float32", "grid": grid}),)

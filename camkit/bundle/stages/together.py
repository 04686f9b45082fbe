"""Numbers of a Wiener bank that restores the colours of a block together (format 2.4)."""

from itertools import pairwise
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from camkit.bundle.entry import Entry, NonNegative

BAND: Final = (0.015, 0.25)
"""Cycles per pixel in which the power of a block is measured."""
BAND_STEP: Final = 3
"""Of every so many frequencies along either axis one is measured."""

Line = tuple[float, ...]
Logarithm = Annotated[float, Field(ge=-20, le=20)]


class Spread(Entry):
    """The scatter of the transfer of fabricated copies around the frozen one.

    Attributes:
        heights_mm: Field heights, increasing from 0.
        frequencies: Cycles per pixel, increasing from 0.
        variance: (height, colour, frequency) mean of |H_copy - H|^2.
    """

    heights_mm: Annotated[Line, Field(min_length=1, max_length=64)]
    frequencies: Annotated[Line, Field(min_length=2, max_length=64)]
    variance: tuple[tuple[Annotated[tuple[NonNegative, ...], Field(max_length=64)], ...], ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("heights_mm", "frequencies"):
            line = getattr(self, name)
            if line[0] != 0 or any(b <= a for a, b in pairwise(line)):
                raise ValueError(f"{name} must increase from 0")
        if len(self.variance) != len(self.heights_mm):
            raise ValueError("variance must have one entry for each of heights_mm")
        colours = {len(of_height) for of_height in self.variance}
        lengths = {len(line) for of_height in self.variance for line in of_height}
        if len(colours) != 1 or lengths != {len(self.frequencies)}:
            raise ValueError("variance must be (height, colour, frequency)")
        return self


class Mosaic(Entry):
    """The places where the bank works from the samples of the mosaic (format 2.10).

    Attributes:
        within_mm: Field height up to which a block's place is one.
        smooth_below: A block that shows less light than so many times the expected is smooth.
        smooth_follow: Exponent with which the power of the light follows what smooth blocks lack,
            besides `follow`; 0 for not at all.
    """

    within_mm: NonNegative
    smooth_below: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    smooth_follow: Annotated[float, Field(ge=0, le=4)] = 0.0


class Together(Entry):
    """The prior of the bank for the colours of a scene, and for their noise.

    Attributes:
        noise: Of every colour, logarithm of its noise over the sensor's at low frequencies, where
            the demosaic piles it up.
        noise_rise: How that logarithm changes with four times the frequency squared.
        scale: Power of the light that all colours share, over the squared level.
        exponent: Of its fall with frequency.
        follow: Exponent with which it follows what a block shows; 0 for not at all.
        own: Power of what a colour has of its own, over that of the shared light.
        mistrust: Times the variance of the transfer.
        spread: That variance.
    """

    noise: tuple[Logarithm, ...]
    noise_rise: tuple[Logarithm, ...]
    scale: Annotated[float, Field(gt=0, le=1e6)]
    exponent: Annotated[float, Field(ge=0, le=8)]
    follow: Annotated[float, Field(ge=0, le=1)]
    own: Annotated[float, Field(gt=0, le=1e6)]
    mistrust: Annotated[float, Field(ge=0, le=1e6)]
    spread: Spread

    @model_validator(mode="after")
    def _check(self) -> Self:
        colours = len(self.spread.variance[0])
        if {len(self.noise), len(self.noise_rise)} != {colours}:
            raise ValueError(f"noise and noise_rise must have one number for each of {colours}")
        return self

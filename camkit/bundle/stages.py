"""The stages a pipeline can have, in the order in which a picture passes through them."""

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from camkit.bundle.camera import Entry, NonNegative, Positive


class WhiteBalance(Entry):
    """Gains of the file or the caller, green = 1."""

    type: Literal["white_balance"] = "white_balance"


class Demosaic(Entry):
    """Mosaic to three linear planes."""

    type: Literal["demosaic"] = "demosaic"
    method: Literal["fast", "quality"] = "quality"


class Wiener(Entry):
    """The Wiener bank: overlapping windowed blocks, each with its own PSF.

    Attributes:
        block_px: Side of a block.
        overlap_px: Overlap of neighbouring blocks, less than half a block or equal to it.
        prior_scale: Scale of the power spectrum assumed for a sharp scene.
        prior_exponent: Its fall with frequency: scale * f^-exponent.
        clip_iterations: Rounds of re-estimating clipped pixels; 0 for none.
    """

    type: Literal["wiener"] = "wiener"
    block_px: Annotated[int, Field(ge=16, le=8192)] = 512
    overlap_px: Annotated[int, Field(ge=0)] = 160
    prior_scale: Positive
    prior_exponent: NonNegative
    clip_iterations: Annotated[int, Field(ge=0, le=100)] = 0

    @model_validator(mode="after")
    def _check(self) -> "Wiener":
        if 2 * self.overlap_px > self.block_px:
            raise ValueError(
                f"overlap_px may be half of block_px at most; got {self.overlap_px} of "
                f"{self.block_px}"
            )
        return self


class Network(Entry):
    """The network on stabilised planes (k-sigma, then square root).

    Attributes:
        scale: Divisor behind the square root; the noise there is 0.5 / scale at any ISO.
    """

    type: Literal["network"] = "network"
    scale: Positive = 64.0


class Illumination(Entry):
    """Division by the relative illumination of the frozen PSF."""

    type: Literal["illumination"] = "illumination"


class Undistort(Entry):
    """Removal of the radial distortion of the frozen PSF, per colour."""

    type: Literal["undistort"] = "undistort"


class Color(Entry):
    """Camera colour to the colour of the output."""

    type: Literal["color"] = "color"


Stage = Annotated[
    WhiteBalance | Demosaic | Wiener | Network | Illumination | Undistort | Color,
    Field(discriminator="type"),
]

STAGE_ORDER: Final = (
    "white_balance",
    "demosaic",
    "wiener",
    "network",
    "illumination",
    "undistort",
    "color",
)

"""The numbers of a network of somebody else: the space of its planes, their range, a noise map."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from camkit.bundle.entry import Entry, Positive

Space = Literal["camera", "rec709", "srgb"]
"""camera: colours of the sensor, white balanced; rec709: linear Rec.709; srgb: that behind the
curve of sRGB."""
Numbers = Annotated[tuple[float, ...], Field(min_length=1, max_length=64)]
"""One for all channels, or one for each."""


class Coding(Entry):
    """The numbers that a network takes and gives for light.

    Light x becomes gain * curve(matrix exposure x) + offset, and what the network gives becomes
    light by the inverse with the numbers of its output. The curve of sRGB goes on beyond 1 and
    below 0, so nothing is cut.

    Attributes:
        output: Space of what it gives.
        exposure: Factor on the light in front of the network, taken back behind it.
        gain: Of the planes taken.
        offset: Of the planes taken.
        output_gain: Of what it gives.
        output_offset: Of what it gives.
        noise: Whether a map of the noise lies behind the planes: the standard deviation of a sample
            of the last plane in the numbers of the network, the root mean square over its channels.
    """

    output: Space
    exposure: Positive = 1.0
    gain: Numbers = (1.0,)
    offset: Numbers = (0.0,)
    output_gain: Numbers = (1.0,)
    output_offset: Numbers = (0.0,)
    noise: bool = False

    @model_validator(mode="after")
    def _check(self) -> Self:
        if 0.0 in (*self.gain, *self.output_gain):
            raise ValueError("a gain of 0 leaves nothing of the picture")
        return self

"""A plane: what runs from one stage to the next, and in what it is measured."""

from typing import Annotated, Literal

from pydantic import Field

from camkit.bundle.entry import Entry, Positive

Axes = Literal["y x", "t y x"]
"""Axes behind that of the channels."""
SampleType = Literal["uint8", "uint16", "uint32", "float32", "bool"]
Domain = Literal["dn", "linear", "stabilised", "counts", "mask", "output", "depth", "lifetime"]
"""dn: digital numbers; linear: light, 1.0 = white level; stabilised: of equal noise everywhere;
counts: photons; mask: true or false; output: linear light in the colour of the output; depth:
metres (2.3); lifetime: picoseconds (2.9)."""


class Grid(Entry):
    """The place of a plane's samples.

    Attributes:
        pitch_ratio: Distance of neighbouring samples over the pixel pitch of the sensor; 0.5 is
            twice as fine.
        origin_px: (x, y) of the first sample from the first pixel of the capture, in its pixels.
        warped: In the geometry of the sensor, with the distortion of the optics; else in that of
            an ideal camera.
    """

    pitch_ratio: Positive = 1.0
    origin_px: tuple[float, float] = (0.0, 0.0)
    warped: bool = True

    def finer(self, scale: int) -> "Grid":
        """Return the grid with `scale` samples where this one has one, about the same centres."""
        fine = self.pitch_ratio / scale
        shift = (fine - self.pitch_ratio) / 2
        x, y = self.origin_px
        return self.model_copy(
            update={"pitch_ratio": fine, "origin_px": (x + shift, y + shift)} if scale > 1 else {}
        )


class Plane(Entry):
    """The description of a plane.

    Attributes:
        axes: Behind the channels.
        type: Of a sample.
        channels: Names, in order.
        domain: What a sample means.
        grid: Where the samples lie.
    """

    axes: Axes = "y x"
    type: SampleType = "float32"
    channels: Annotated[
        tuple[Annotated[str, Field(pattern=r"^[A-Za-z0-9_]{1,16}$")], ...],
        Field(min_length=1, max_length=1024),
    ]
    domain: Domain
    grid: Grid = Grid()

    def describe(self) -> str:
        """Return the plane in words."""
        grid = f"pitch {self.grid.pitch_ratio:g}" + ("" if self.grid.warped else ", undistorted")
        channels = ", ".join(self.channels[:6]) + (", ..." if len(self.channels) > 6 else "")
        return f"({channels}) {self.domain} {self.type} over {self.axes}, {grid}"

    def stands_for(self, other: "Plane") -> bool:
        """Return whether this plane may stand in for `other`: only samples differ."""
        return (
            self.axes == other.axes
            and self.type == other.type
            and len(self.channels) == len(other.channels)
            and self.domain == other.domain
            and self.grid.pitch_ratio == other.grid.pitch_ratio
            and self.grid.origin_px == other.grid.origin_px
        )

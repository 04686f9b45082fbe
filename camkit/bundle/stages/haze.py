"""The haze of the optics taken away: what is left is blurred by their core kernels alone."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import (
    JoinError,
    Parts,
    StageEntry,
    need_colours,
    need_count,
    need_domain,
    need_masks,
    need_rows,
)
from camkit.haze import LEAST_CELL_PX, MOST_CELL_PX


class Dehaze(StageEntry):
    """The haze of the optics undone in a coarse picture of the whole frame (format 2.7).

    Attributes:
        shrink: Side in pixels of a cell of the coarse picture, that of the haze of the optics.
        terms: Kernels, each with a weight that varies over the frame, whose sum stands for the
            kernels of every place; where the optics have fewer places these stand for themselves.
        rounds: Of solving for the coarse picture.
    """

    type: Literal["haze"] = "haze"
    takes: tuple[Word, ...] = ("rgb", "unknown")
    gives: tuple[Word, ...] = ("clear",)
    shrink: Annotated[int, Field(ge=LEAST_CELL_PX, le=MOST_CELL_PX, multiple_of=2)] = 16
    terms: Annotated[int, Field(ge=1, le=128)] = 32
    rounds: Annotated[int, Field(ge=1, le=16)] = 3

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane as taken, its light in the cores."""
        need_count(planes, 1, 2)
        plane = planes[0]
        need_domain(plane, "linear")
        need_rows(plane)
        need_masks(planes[1:], plane, "clears")
        optics = parts.need_optics("it undoes the haze of optics")
        if optics.type != "hazy_psf":
            raise JoinError(f"it needs optics with a haze (hazy_psf), not {optics.type}")
        if optics.cell_px != self.shrink:
            raise JoinError(
                f"its cells have {self.shrink} px, those of the haze of the optics {optics.cell_px}"
            )
        need_colours(plane, parts)
        if not plane.grid.warped or plane.grid.pitch_ratio != 1:
            raise JoinError("it works on the pixels of the sensor, before any undistortion")
        return (plane,)

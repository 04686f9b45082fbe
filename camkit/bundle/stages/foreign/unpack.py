"""Pictures made of cells of a mosaic, cut to the samples of the capture."""

from collections.abc import Sequence
from typing import ClassVar, Literal

from camkit.bundle.entry import Since, Word
from camkit.bundle.plane import Grid, Plane
from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_count, one_linear
from camkit.bundle.stages.foreign.pack import CELL_GRID, CODED, PLACES


class Unpack(StageEntry):
    """Pictures made of whole cells, cut to the samples of the capture.

    Four planes of half the size, as `Pack` gives them, become a mosaic again.
    """

    since: ClassVar[Since | None] = CODED
    type: Literal["unpack"] = "unpack"
    takes: tuple[Word, ...] = ("clean",)
    gives: tuple[Word, ...] = ("whole",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return a mosaic, or the plane taken."""
        del parts
        need_count(planes, 1)
        plane = one_linear(planes)
        if plane.grid == CELL_GRID and set(plane.channels) == set(PLACES):
            return (plane.model_copy(update={"channels": MOSAIC, "grid": Grid()}),)
        if plane.grid.pitch_ratio > 1:
            raise JoinError("it takes R, G1, G2 and B, or a picture at least as fine as the sensor")
        return (plane,)

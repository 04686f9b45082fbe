"""The samples of a mosaic as planes of half the size."""

from collections.abc import Sequence
from typing import ClassVar, Final, Literal, Self

from pydantic import model_validator

from camkit.bundle.entry import Since, Word
from camkit.bundle.plane import Grid, Plane
from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear

CodedColour = Literal["R", "G1", "G2", "B"]
PLACES: Final[dict[CodedColour, tuple[int, int]]] = {
    "R": (0, 0),
    "G1": (0, 1),
    "G2": (1, 0),
    "B": (1, 1),
}
"""(row, column) of a sample in its cell, which begins with red: G1 beside red, G2 beside blue."""
CODED: Final = Since((2, 11), "a network takes what networks of others take")
CELL_PX: Final = 2
CELL_GRID: Final = Grid(pitch_ratio=2.0, origin_px=(0.5, 0.5))


class Pack(StageEntry):
    """A mosaic to four planes of half its size, a cell of 2x2 samples to a sample of each.

    Cells begin with red wherever the capture begins: a row and a column are put before captures
    that begin with another colour, and behind all of them as many that whole cells come out. What
    is put there is mirrored about the border sample.

    Attributes:
        order: Of the planes.
    """

    since: ClassVar[Since | None] = CODED
    type: Literal["pack"] = "pack"
    takes: tuple[Word, ...] = ("balanced",)
    gives: tuple[Word, ...] = ("packed",)
    order: tuple[CodedColour, CodedColour, CodedColour, CodedColour] = ("R", "G1", "G2", "B")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(set(self.order)) != len(PLACES):
            raise ValueError(f"order must name R, G1, G2 and B once; got {', '.join(self.order)}")
        return self

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the four planes."""
        del parts
        plane = one_linear(planes)
        if plane.channels != MOSAIC or plane.grid.pitch_ratio != 1:
            raise JoinError("it takes a mosaic")
        return (plane.model_copy(update={"channels": self.order, "grid": CELL_GRID}),)

"""Camera colour to the colour of the output."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear


class Color(StageEntry):
    """Camera colour to the colour of the output; one channel becomes grey."""

    type: Literal["color"] = "color"
    takes: tuple[Word, ...] = ("straight",)
    gives: tuple[Word, ...] = ("picture",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return three planes in the colour of the output."""
        del parts
        plane = one_linear(planes)
        if plane.channels == MOSAIC:
            raise JoinError("a mosaic has no colour yet; it must be demosaicked")
        if len(plane.channels) not in (1, len(RGB)):
            raise JoinError(f"it takes one channel or three, not {len(plane.channels)}")
        return (plane.model_copy(update={"channels": RGB, "domain": "output"}),)

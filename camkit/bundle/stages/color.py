"""Camera colour to the colour of the output."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_count, need_domain


class Color(StageEntry):
    """Camera colour to the colour of the output; one channel becomes grey."""

    type: Literal["color"] = "color"
    takes: tuple[Word, ...] = ("straight",)
    gives: tuple[Word, ...] = ("picture",)

    def join(self, taken: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Give three planes in the colour of the output."""
        del parts
        need_count(taken, 1)
        need_domain(taken[0], "linear")
        if taken[0].channels == MOSAIC:
            raise JoinError("a mosaic has no colour yet; it must be demosaicked")
        if len(taken[0].channels) not in (1, len(RGB)):
            raise JoinError(f"it takes one channel or three, not {len(taken[0].channels)}")
        return (taken[0].model_copy(update={"channels": RGB, "domain": "output"}),)

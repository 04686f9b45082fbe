"""A mosaic made three linear planes."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear


class Demosaic(StageEntry):
    """Mosaic to three linear planes."""

    type: Literal["demosaic"] = "demosaic"
    takes: tuple[Word, ...] = ("balanced",)
    gives: tuple[Word, ...] = ("rgb",)
    method: Literal["fast", "quality"] = "quality"

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the three planes."""
        del parts
        plane = one_linear(planes)
        if plane.channels != MOSAIC:
            raise JoinError("it takes a mosaic")
        return (plane.model_copy(update={"channels": RGB}),)

"""Burnt-out light made neutral."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear


class RaiseClipped(StageEntry):
    """Clipped channels raised to the others, so that burnt-out light is neutral, never magenta."""

    type: Literal["raise_clipped"] = "raise_clipped"
    takes: tuple[Word, ...] = ("clean",)
    gives: tuple[Word, ...] = ("neutral",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return a plane of the kind taken."""
        del parts
        plane = one_linear(planes)
        if plane.channels != RGB:
            raise JoinError("it takes red, green and blue")
        return (plane,)

"""Times of photons to the lifetime of what sent them."""

from collections.abc import Sequence
from typing import ClassVar, Literal

from camkit.bundle.entry import Since, Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_counts_of_pixels


class Lifetime(StageEntry):
    """The lifetime of fluorescence in every pixel of an array (format 2.9)."""

    since: ClassVar[Since | None] = Since((2, 9), "it lists the stage lifetime")
    runtime: ClassVar[str] = "camkit.runtime.kinds.spad.stages.lifetime"
    type: Literal["lifetime"] = "lifetime"
    takes: tuple[Word, ...] = ("photons",)
    gives: tuple[Word, ...] = ("lifetime",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the lifetimes."""
        del parts
        plane = need_counts_of_pixels(planes)
        if plane.axes != "t y x":
            raise JoinError("it takes photons by time (t y x); the sensor states no time_bins")
        return (plane.model_copy(update={"axes": "y x", "domain": "lifetime"}),)

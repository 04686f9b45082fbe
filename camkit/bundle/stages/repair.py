"""Dead and invalid samples replaced."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_count, need_domain


class Repair(StageEntry):
    """Samples that stand alone, NaN and inf are replaced by the median around them.

    With a mask of what clipped it also gives the mask of what stays unknown: a hot pixel is
    clipped as well, but its light is known from its neighbours.
    """

    type: Literal["repair"] = "repair"
    takes: tuple[Word, ...] = ("light", "clipped")
    gives: tuple[Word, ...] = ("sound", "unknown")

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return planes of the kind taken."""
        del parts
        need_count(planes, 1, 2)
        need_domain(planes[0], "linear")
        for mask in planes[1:]:
            need_domain(mask, "mask")
            if mask.grid != planes[0].grid or mask.channels != planes[0].channels:
                raise JoinError("its mask must lie on the samples that it repairs")
        if len(self.gives) > len(planes):
            raise JoinError("it gives a mask only where it takes one")
        return tuple(planes[: len(self.gives)])

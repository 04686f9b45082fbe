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

    def join(self, taken: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return planes of the kind taken."""
        del parts
        need_count(taken, 1, 2)
        need_domain(taken[0], "linear")
        for mask in taken[1:]:
            need_domain(mask, "mask")
            if mask.grid != taken[0].grid or mask.channels != taken[0].channels:
                raise JoinError("its mask must lie on the samples that it repairs")
        if len(self.gives) > len(taken):
            raise JoinError("it gives a mask only where it takes one")
        return tuple(taken[: len(self.gives)])

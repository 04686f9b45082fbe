"""Photons of a capture: dark counts, pile-up and hot pixels undone."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import Parts, StageEntry, need_count, need_domain


class Correct(StageEntry):
    """Counts as those of an array without dark counts and dead time (format 2.3)."""

    type: Literal["correct"] = "correct"
    takes: tuple[Word, ...] = ("capture",)
    gives: tuple[Word, ...] = ("photons",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the photons, over the axes of the capture."""
        del parts
        need_count(planes, 1)
        need_domain(planes[0], "counts")
        return (planes[0].model_copy(update={"type": "float32"}),)

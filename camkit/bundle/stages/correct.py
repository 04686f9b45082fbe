"""Photons of a capture: dark counts, pile-up and hot pixels undone."""

from collections.abc import Sequence
from typing import ClassVar, Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import Parts, StageEntry, need_counts_of_pixels


class Correct(StageEntry):
    """Counts as those of an array without dark counts and dead time (format 2.3)."""

    runtime: ClassVar[str] = "camkit.runtime.kinds.spad.stages.correct"
    type: Literal["correct"] = "correct"
    takes: tuple[Word, ...] = ("capture",)
    gives: tuple[Word, ...] = ("photons",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the photons, over the axes of the capture."""
        del parts
        return (need_counts_of_pixels(planes).model_copy(update={"type": "float32"}),)

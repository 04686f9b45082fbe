"""Lights that the sensor clipped, read back from the streaks that the optics wrote of them."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear


class Highlights(StageEntry):
    """Clipped lights found from their streaks, streaks and veil taken away (format 2.2)."""

    type: Literal["highlights"] = "highlights"
    takes: tuple[Word, ...] = ("rgb",)
    gives: tuple[Word, ...] = ("lit",)

    def join(self, taken: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Give the plane as taken; its lights may lie far above white."""
        plane = one_linear(taken)
        if plane.channels != RGB:
            raise JoinError("it takes red, green and blue")
        if not plane.grid.warped or plane.grid.pitch_ratio != 1:
            raise JoinError("it works on the pixels of the sensor, before any undistortion")
        optics = parts.need_optics("it reads lights from the streaks of optics")
        if optics.type != "streaks":
            raise JoinError(f"it needs optics that write streaks, not {optics.type}")
        return (plane,)

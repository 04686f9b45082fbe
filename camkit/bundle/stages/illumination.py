"""Division by the relative illumination of the optics."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_rows, one_linear


class Illumination(StageEntry):
    """Division by the relative illumination of the optics."""

    type: Literal["illumination"] = "illumination"
    takes: tuple[Word, ...] = ("neutral",)
    gives: tuple[Word, ...] = ("even",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return a plane of the kind taken."""
        plane = one_linear(planes)
        need_rows(plane)
        optics = parts.need_optics("it divides by the illumination of optics")
        if optics.type == "lens_profile" and optics.illumination is None:
            raise JoinError("the lens_profile states no illumination")
        if not plane.grid.warped:
            raise JoinError("it works in the geometry of the sensor, before any undistortion")
        return (plane,)

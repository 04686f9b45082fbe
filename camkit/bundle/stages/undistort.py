"""Removal of the radial distortion of the optics."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages.entry import (
    JoinError,
    Parts,
    StageEntry,
    need_count,
    need_domain,
    need_rows,
)


class Undistort(StageEntry):
    """Removal of the radial distortion of the frozen PSF, per channel."""

    type: Literal["undistort"] = "undistort"
    takes: tuple[Word, ...] = ("even",)
    gives: tuple[Word, ...] = ("straight",)

    def join(self, taken: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Give the plane in ideal geometry."""
        need_count(taken, 1)
        need_domain(taken[0], "linear")
        need_rows(taken[0])
        parts.need_optics("it undoes the distortion of optics")
        if not taken[0].grid.warped:
            raise JoinError("it takes the geometry of the sensor; this plane is undistorted")
        if taken[0].channels == MOSAIC:
            raise JoinError("a mosaic cannot be moved")
        if len(taken[0].channels) != len(parts.sensor.channels):
            raise JoinError(
                f"the distortion is known for {', '.join(parts.sensor.channels)}, not for "
                f"{', '.join(taken[0].channels)}"
            )
        return (
            taken[0].model_copy(
                update={"grid": taken[0].grid.model_copy(update={"warped": False})}
            ),
        )

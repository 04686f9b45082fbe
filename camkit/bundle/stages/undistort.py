"""Removal of the radial distortion of the optics."""

from collections.abc import Sequence
from typing import Annotated, Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC
from camkit.bundle.stages.entry import (
    BOUNDED,
    PORTABLE,
    JoinError,
    Parts,
    StageEntry,
    need_rows,
    one_linear,
)

Interpolation = Literal["lanczos", "cubic"]
Overshoot = Literal["limited", "kept"]
Places = Literal["float", "fixed"]


class Undistort(StageEntry):
    """Removal of the radial distortion of the optics, per channel.

    Attributes:
        interpolation: Between pixels: lanczos (8x8), as before, or cubic (4x4) for a third of
            its time (format 2.4).
        overshoot: limited: at the rim of light above white, and where it falls below -0.02, a value
            stays within the range of the samples that it is interpolated from (format 2.8); kept:
            nowhere, as before.
        places: Where pixels come from, on nodes every 8 px and linear between them. fixed: nodes
            rounded to 1/256 px and places to 1/32 px, which leaves no rounding to chance: any
            reader finds the same (format 2.12). float: in single precision, as before.
    """

    type: Literal["undistort"] = "undistort"
    takes: tuple[Word, ...] = ("even",)
    gives: tuple[Word, ...] = ("straight",)
    interpolation: Interpolation = "lanczos"
    overshoot: Annotated[Overshoot, BOUNDED] = "kept"
    places: Annotated[Places, PORTABLE] = "float"

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane in ideal geometry."""
        plane = one_linear(planes)
        need_rows(plane)
        optics = parts.need_optics("it undoes the distortion of optics")
        if optics.type == "lens_profile" and optics.distortion is None:
            raise JoinError("the lens_profile states no distortion")
        if not plane.grid.warped:
            raise JoinError("it takes the geometry of the sensor; this plane is undistorted")
        if plane.channels == MOSAIC:
            raise JoinError("a mosaic cannot be moved")
        if len(plane.channels) != len(parts.sensor.channels):
            raise JoinError(
                f"the distortion is known for {', '.join(parts.sensor.channels)}, not for "
                f"{', '.join(plane.channels)}"
            )
        return (plane.model_copy(update={"grid": plane.grid.model_copy(update={"warped": False})}),)

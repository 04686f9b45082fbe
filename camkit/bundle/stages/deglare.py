"""Streaks of glare taken away, as a wiped windshield writes them; lights stay as they are."""

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_rows, one_linear

Angle = Annotated[float, Field(ge=0, le=40)]


class Deglare(StageEntry):
    """Two opposite streaks through every light, of one angle per picture (format 2.2).

    Attributes:
        least_angle_deg: Least angle of the streaks from the vertical, to either side.
        most_angle_deg: Largest.
        reach: How far they reach from their light, as a share of the diagonal of the picture.
        level: Light is what reaches this share of where a colour clips.
    """

    runtime: ClassVar[str] = "camkit.runtime.kinds.hdr.stages.deglare"
    type: Literal["deglare"] = "deglare"
    takes: tuple[Word, ...] = ("rgb",)
    gives: tuple[Word, ...] = ("clear",)
    least_angle_deg: Angle = 2.5
    most_angle_deg: Angle = 8.0
    reach: Annotated[float, Field(gt=0, le=1)] = 0.25
    level: Annotated[float, Field(ge=0.1, le=1)] = 0.9

    @model_validator(mode="after")
    def _check(self) -> "Deglare":
        if self.least_angle_deg >= self.most_angle_deg:
            raise ValueError(
                f"least_angle_deg {self.least_angle_deg:g} must lie below most_angle_deg "
                f"{self.most_angle_deg:g}"
            )
        return self

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the plane as taken."""
        del parts
        plane = one_linear(planes)
        need_rows(plane)
        if plane.channels != RGB:
            raise JoinError("it takes red, green and blue")
        return (plane,)

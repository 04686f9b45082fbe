"""Digital numbers to light: black is 0, the white level 1, and what clipped is marked."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, need_count, need_domain


class Linearise(StageEntry):
    """Black level subtracted, divided by the range; negative values stay. The mask is optional."""

    type: Literal["linearise"] = "linearise"
    takes: tuple[Word, ...] = ("capture",)
    gives: tuple[Word, ...] = ("light", "clipped")

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the linear plane and the mask."""
        need_count(planes, 1)
        need_domain(planes[0], "dn")
        if not isinstance(parts.sensor, ColorSensor):
            raise JoinError(f"a sensor of type {parts.sensor.type} has no black and white level")
        light = planes[0].model_copy(update={"domain": "linear", "type": "float32"})
        mask = planes[0].model_copy(update={"domain": "mask", "type": "bool"})
        return (light, mask)[: len(self.gives)]

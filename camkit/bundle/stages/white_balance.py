"""Channels multiplied so that grey is grey."""

from collections.abc import Sequence
from typing import Literal

from camkit.bundle.entry import Word
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages.entry import JoinError, Parts, StageEntry, one_linear


class WhiteBalance(StageEntry):
    """Gains of the file or the caller, green = 1."""

    type: Literal["white_balance"] = "white_balance"
    takes: tuple[Word, ...] = ("sound",)
    gives: tuple[Word, ...] = ("balanced",)

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return a plane of the kind taken."""
        plane = one_linear(planes)
        if parts.sensor.channels != RGB or plane.channels not in (MOSAIC, RGB):
            raise JoinError("it balances red, green and blue, which these planes are not")
        return (plane,)

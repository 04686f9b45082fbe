"""The pose of a photographed object in a picture: its shift and turn against the pose zero.

A point of the object that lies at q in the pose zero is seen at p = R q + s, both in pixels from
the middle of the picture, x to the right and y down; R turns clockwise as one looks at the picture.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.errors import ContractError

FloatGrid = NDArray[np.float64]
MOST_SHIFT_PX = 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """The pose of a picture.

    Attributes:
        shift_px: (x, y) by which what is photographed moved in the picture.
        turn_rad: By which it turned, clockwise, about the middle of the picture.
    """

    shift_px: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0

    def __post_init__(self) -> None:
        if not all(abs(part) <= MOST_SHIFT_PX for part in self.shift_px):
            raise ContractError(f"a shift is two numbers of pixels; got {self.shift_px}")
        if not math.isfinite(self.turn_rad):
            raise ContractError(f"a turn is a number; got {self.turn_rad}")

    def places(self, x: FloatGrid, y: FloatGrid) -> tuple[FloatGrid, FloatGrid]:
        """Return places of what is photographed that are seen at pixels, both from the middle."""
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        dx, dy = x - self.shift_px[0], y - self.shift_px[1]
        return cos * dx + sin * dy, cos * dy - sin * dx

    def reversed(self, *, shift: bool, turn: bool) -> "Pose":
        """Return the pose with shifts or turns of the opposite sign."""
        x, y = self.shift_px
        return Pose(
            shift_px=(-x, -y) if shift else self.shift_px,
            turn_rad=-self.turn_rad if turn else self.turn_rad,
        )


def orientation_turn_deg(orientation: int) -> float:
    """Return the turn in degrees of a picture that has an EXIF orientation."""
    return {3: 180.0, 6: -90.0, 8: 90.0}.get(orientation, 0.0)


def poses_of(
    shifts: Sequence[str | tuple[float, float]] | None,
    turns: Sequence[float] | None,
    exif_turns: Sequence[float],
) -> list[Pose]:
    """Return the poses that a person states.

    Args:
        shifts: (x, y) or "x,y" in pixels for each picture; None for no shifts.
        turns: Degrees for each picture; None for `exif_turns`.
        exif_turns: Turns in degrees by the EXIF orientation of the pictures.

    Raises:
        ContractError: If there is not one for each picture, or one is no pair of numbers.
    """
    count = len(exif_turns)
    for option, values in (("shift_px", shifts), ("turn_deg", turns)):
        if values and len(values) != count:
            raise ContractError(
                f"{option_text(option)} is given {len(values)} times for {count} pictures; give it "
                "once for each, in their order"
            )
    return [
        Pose(shift_px=_pair(shift), turn_rad=math.radians(turn))
        for shift, turn in zip(shifts or ["0,0"] * count, turns or exif_turns, strict=True)
    ]


def _pair(text: str | tuple[float, float]) -> tuple[float, float]:
    try:
        x, y = map(float, text.split(",") if isinstance(text, str) else text)
    except ValueError:
        raise ContractError(
            f"{option_text('shift_px')} takes two numbers X,Y; got {text!r}"
        ) from None
    return x, y

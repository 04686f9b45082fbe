"""The working points of the prototype, a 64x32 gated array of 150 um pixels.

References: Sun 2021, section 4.5; Sun, Fu, Dun, Zheng, Heidrich 2020.
"""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkingPoint:
    """The duration and the light of a count.

    Attributes:
        frames: Put together to one picture, or to one step of the gate.
        frame_us: Time of each.
    """

    frames: int
    frame_us: float

    @property
    def time_s(self) -> float:
        """Return the time for which a picture, or a step, is counted."""
        return self.frames * self.frame_us * 1e-6


WORKING_POINTS: Final = {
    "intensity": WorkingPoint(frames=100, frame_us=52.0),
    "high_speed": WorkingPoint(frames=10, frame_us=80.0),
    "depth": WorkingPoint(frames=1500, frame_us=52.0),
}
"""High speed gives 1,250 pictures a second; depth counts so long at every delay of the gate."""
STEP_PS: Final = 20.0
"""From one delay of the gate to the next."""
GATE_WIDTH_PS: Final = 200.0

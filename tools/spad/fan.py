"""A fan that turns before an array, and the angle of its blades in a picture.

Straight blades with soft edges, dark ground, a ring and a hub. The shutter is open all the time, so
a frame shows the blades smeared over the angle they turn in it.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray

Floats = NDArray[np.float64]
GROUND: Final = 0.08
BLADE: Final = 0.9
METAL: Final = 0.5
EDGE_PX: Final = 0.7
"""Sub-pixels over which an edge rises."""
SUB_FRAMES: Final = 10
"""Put together to a frame, see the working point high_speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fan:
    """A fan.

    Attributes:
        size_px: (height, width) of its picture, in sub-pixels; the hub is in the middle.
        blades: How many.
        blade_rad: Width of each.
        radius_px: Of the blades.
        hub_px: Radius of the hub.
        turn_rad: How far it turns from one frame to the next.
    """

    size_px: tuple[int, int]
    blades: int = 3
    blade_rad: float = math.radians(40)
    radius_px: float = 56.0
    hub_px: float = 9.0
    turn_rad: float = math.radians(18)

    def frames(self, count: int) -> tuple[FloatArray, Floats]:
        """Return frames (n, h, w), white = 1, and the mean angle of a blade in each."""
        step = self.turn_rad / SUB_FRAMES
        found = np.empty((count, *self.size_px), np.float32)
        middles = np.empty(count)
        for number in range(count):
            angles = number * self.turn_rad + step * np.arange(SUB_FRAMES)
            found[number] = np.mean([self.still(angle) for angle in angles], axis=0)
            middles[number] = angles.mean()
        return found, middles

    def still(self, angle_rad: float) -> FloatArray:
        """Return a picture (h, w) without motion, the middle of a blade at an angle."""
        radius, around = self._polar()
        period = 2 * math.pi / self.blades
        beside = np.abs((around - angle_rad + period / 2) % period - period / 2)
        # how far inside the blade, in sub-pixels along the circle
        blade = _edge(radius * (self.blade_rad / 2 - beside)) * _edge(self.radius_px - radius)
        picture = GROUND + (BLADE - GROUND) * blade
        ring = _edge(2 - np.abs(radius - self.radius_px - 4))
        for share in (_edge(self.hub_px - radius), ring):
            picture += share * (METAL - picture)
        return np.asarray(picture, np.float32)

    def angle_of(self, picture: FloatArray) -> float:
        """Find the angle of a blade, in [0, 2 pi / blades): of n blades, by their n-th harmonic.

        The sum of light times exp(i n phi) over the ring that blades alone sweep; its phase over n
        is where their middles are, whatever is even around the hub.
        """
        radius, around = self._polar()
        swept = (radius > self.hub_px + 3) & (radius < self.radius_px - 3)
        light = np.asarray(picture, np.float64)[swept]
        total = np.sum(light * np.exp(1j * self.blades * around[swept]))
        return float(np.angle(total) % (2 * math.pi)) / self.blades

    def off_by(self, found_rad: float, true_rad: float) -> float:
        """Return by how much an angle is off; blades look alike."""
        period = 2 * math.pi / self.blades
        return (found_rad - true_rad + period / 2) % period - period / 2

    def _polar(self) -> tuple[Floats, Floats]:
        height, width = self.size_px
        y, x = np.mgrid[:height, :width]
        down, right = y - (height - 1) / 2, x - (width - 1) / 2
        return np.hypot(down, right), np.arctan2(down, right)


def _edge(inside_px: Floats) -> Floats:
    return np.asarray(0.5 * (1 + np.tanh(inside_px / EDGE_PX)))

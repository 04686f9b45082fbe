"""An element that stands tilted or decentred by design."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from camkit.errors import ContractError
from camkit.units import to_radians

MOST_TILT_RAD: Final = 0.5

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stance:
    """The stance of a piece of glass: turned about its front vertex, then shifted.

    Attributes:
        decentre_mm: Along x and y.
        tilt_rad: A rotation vector (x, y): its x turns y towards z.
    """

    decentre_mm: Pair = (0.0, 0.0)
    tilt_rad: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.decentre_mm, *self.tilt_rad))):
            raise ContractError(f"a tilt or decentre must be finite; got {self}")
        if math.hypot(*self.tilt_rad) > MOST_TILT_RAD:
            raise ContractError(
                f"a tilt must be at most {math.degrees(MOST_TILT_RAD):.1f} degrees; got {self}"
            )

    def turned(self, azimuth_rad: float) -> "Stance":
        """Return it seen with the direction at an azimuth (from +y towards +x) at +y."""
        cos, sin = math.cos(azimuth_rad), math.sin(azimuth_rad)

        def turn(vector: Pair) -> Pair:
            x, y = vector
            return cos * x - sin * y, sin * x + cos * y

        return Stance(decentre_mm=turn(self.decentre_mm), tilt_rad=turn(self.tilt_rad))


def parse_stance(
    decentre_mm: tuple[float, ...] | None, tilt_deg: tuple[float, ...] | None
) -> Stance | None:
    """Return the stance that the keys of a surface state; None if they are missing.

    Raises:
        ContractError: If one is no pair of numbers.
    """
    pairs = (decentre_mm, tilt_deg)
    if pairs == (None, None):
        return None
    if any(pair is not None and len(pair) != 2 for pair in pairs):
        raise ContractError("element_decentre_mm and element_tilt_deg are lists of two numbers")
    (x, y), (a, b) = (pair or (0.0, 0.0) for pair in pairs)
    return Stance(decentre_mm=(x, y), tilt_rad=(to_radians(a), to_radians(b)))


def check_stances(parts: Sequence[tuple[Stance | None, str]], stop: int) -> None:
    """Refuse stances that begin no piece of glass, and a stop on glass that stands askew.

    Args:
        parts: Stance and glass after it of every surface.
        stop: Number of the surface of the stop.

    Raises:
        ContractError: Naming the surface.
    """
    media = ["air", *(glass for _, glass in parts)]
    skewed = False
    for i, (stance, glass) in enumerate(parts):
        if stance is not None:
            if media[i] != "air" or glass == "air":
                raise ContractError(
                    f"surface {i} begins no piece of glass; a tilt or decentre stands at the first "
                    "surface of the piece"
                )
            skewed = True
        if skewed and i == stop:
            raise ContractError(
                f"the stop, surface {i}, lies on glass that is tilted or decentred; state the stop "
                "as a surface of its own in air"
            )
        skewed = skewed and glass != "air"

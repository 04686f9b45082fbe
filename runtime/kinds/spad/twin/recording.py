"""A scene recorded: how much light there is, and what is recorded of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotonOptions:
    """The options of recording a scene.

    Attributes:
        photons: That are counted, whatever the sensor's detection efficiency: of a pixel that sees
            white; of captures by time, of a pixel on average. A pixel that sees all of itself
            collects as many for every sub-pixel.
        sbr: Photons of the signal over those of the background, all time bins together.
        seed: Of chance; the same seed gives the same capture.
    """

    photons: float
    sbr: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.photons) and self.photons > 0):
            raise ContractError(f"photons must be a number > 0; got {self.photons}")
        if not self.sbr > 0:
            raise ContractError(f"sbr must be > 0; got {self.sbr}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A simulated capture.

    Attributes:
        name: What its array is called in files.
        values: The array.
        attributes: What a file should say of it, by name.
        notes: What the user should know of how the scene was recorded.
    """

    name: str
    values: NDArray[Any]
    attributes: Mapping[str, Any]
    notes: tuple[str, ...] = ()

"""The control: detail that is in no capture, planted into a picture; the report must find it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.arrays import FloatArray

PERIOD_PX: Final = 16
STRENGTH: Final = 0.5
"""Of the local level: bright bars are so much brighter."""
LEAST_LEVEL: Final = 0.05
COUNT: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Planted:
    """A picture with detail of ours.

    Attributes:
        picture: (3, h, w) linear Rec.709.
        places: (y, x) of the first pixel of every patch that holds some.
    """

    picture: FloatArray
    places: tuple[tuple[int, int], ...]


def plant(
    picture: FloatArray,
    corners: list[tuple[int, int]],
    side_px: int,
    *,
    strength: float = STRENGTH,
    period_px: int = PERIOD_PX,
    seed: int = 0,
) -> Planted:
    """Add bars, faded to nothing at the rims, into some patches.

    Args:
        picture: (3, h, w) linear Rec.709.
        corners: (y, x) of the first pixel of the patches to choose from.
        side_px: Of a patch.
        strength: Of the bars, as a share of the mean of the patch.
        period_px: Of the bars.
        seed: Of the choice.
    """
    rng = np.random.default_rng(seed)
    count = min(COUNT, len(corners))
    indices = sorted(rng.choice(len(corners), count, replace=False).tolist())
    planted = picture.copy()
    fade = np.hanning(side_px)
    waves = np.sin(2 * np.pi * np.arange(side_px) / period_px)
    bars = (np.outer(fade, fade) * waves).astype(np.float32)
    for index in indices:
        y, x = corners[index]
        part = planted[:, y : y + side_px, x : x + side_px]
        level = max(float(part.mean()), LEAST_LEVEL)
        part += np.float32(strength * level) * bars
    np.maximum(planted, 0, out=planted)
    return Planted(picture=planted, places=tuple(corners[index] for index in indices))

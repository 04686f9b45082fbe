"""Black measured in the MaskedAreas of a DNG, where the sensor sees no light.

What is measured takes the place of BlackLevel, as LibRaw does it, if the areas are dark: quiet, and
outside the active area. LibRaw rounds the means down and measures areas of light too.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.files.dng.picture_tags import DngPicture, Rectangle, numbers_of

MASKED_AREAS: Final = 50830
LEAST_SAMPLES: Final = 64
"""Of each colour, so that the mean is known to an eighth of the noise."""
QUIET_SPREAD: Final = 0.02
BLACK_TOLERANCE: Final = 0.005
"""In shares of the range; nearer is the drift of black with temperature."""
_DAMAGED: Final = ": the header is damaged, BlackLevel is used"


def masked_black(
    picture: DngPicture,
    whole: NDArray[Any],
    stated_black: FloatArray,
    white: float,
    first: Sequence[int],
) -> tuple[FloatArray, list[str]]:
    """Return black as measured, or as stated where nothing can be measured, and notes.

    Args:
        picture: The sensor picture.
        whole: (h, w) or (h, w, plane) samples of the whole sensor.
        stated_black: (2, 2) or (plane,) black by position in the cell, or by plane.
        white: White level.
        first: Row and column of the first visible pixel on the whole sensor.
    """
    values = numbers_of(picture.directory, MASKED_AREAS)
    if not values:
        return stated_black, []
    areas = [_rectangle(values[n : n + 4]) for n in range(0, len(values), 4)]
    active = picture.active_area
    sound = [a for a in areas if a is not None and _inside(a, whole.shape) and not _meet(a, active)]
    if len(sound) < len(areas):
        return stated_black, [
            f"MaskedAreas {tuple(int(n) if np.isfinite(n) else n for n in values)} lie outside "
            f"the sensor or on the picture{_DAMAGED}"
        ]
    measured = np.empty_like(stated_black)
    for place in np.ndindex(stated_black.shape):
        dark = np.concatenate([_samples(whole, area, place, first) for area in sound])
        if dark.size < LEAST_SAMPLES:
            return stated_black, ["MaskedAreas are too small to measure black, BlackLevel is used"]
        low, high = np.quantile(dark, (0.05, 0.95))
        if high - low > QUIET_SPREAD * (white - low):
            return stated_black, [f"MaskedAreas are not dark{_DAMAGED}"]
        measured[place] = dark.mean(dtype=np.float64)
    black, was = float(measured.mean()), float(stated_black.mean())
    note = f"black level {black:.1f}, measured in the masked areas, replaces the stated {was:g}"
    is_far = abs(black - was) > BLACK_TOLERANCE * (white - black)
    return measured, [note + (": the header is damaged" if is_far else "")]


def _samples(
    whole: NDArray[Any], area: Rectangle, place: tuple[int, ...], first: Sequence[int]
) -> NDArray[Any]:
    top, left, bottom, right = area
    part = whole[top:bottom, left:right]
    if len(place) == 1:
        return part[..., place[0]].ravel() if part.ndim == 3 else part.ravel()
    down, across = (first[0] + place[0] - top) % 2, (first[1] + place[1] - left) % 2
    return part[down::2, across::2].ravel()


def _rectangle(values: Sequence[float]) -> Rectangle | None:
    if len(values) != 4 or not np.isfinite(values).all():
        return None
    top, left, bottom, right = (int(n) for n in values)
    return top, left, bottom, right


def _inside(area: Rectangle, shape: Sequence[int]) -> bool:
    top, left, bottom, right = area
    return 0 <= top < bottom <= shape[0] and 0 <= left < right <= shape[1]


def _meet(one: Rectangle, two: Rectangle) -> bool:
    return one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3]

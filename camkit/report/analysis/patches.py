"""A picture in square patches: how each differs from the truth, and what the capture denies."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.ndimage

from camkit.arrays import FloatArray
from camkit.colorimetry import encode_srgb
from camkit.report.analysis.perceptual import Measure
from camkit.report.analysis.point_image import Array
from camkit.report.quality import BORDER_PX

REACH_PX: Final = 5
"""A picture overshoots where it leaves the range of the truth within so many pixels."""
MEASURES: Final = ("l1", "l2", "perceptual", "overshoot", "chi2", "detail", "excess")


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """One patch of one picture.

    Attributes:
        scene: Name of the picture.
        place: (y, x) of its first pixel.
        values: Measure -> value; NaN where nothing can be said. `l1` is the mean absolute and `l2`
            the root of the mean square difference of sRGB values.
    """

    scene: str
    place: tuple[int, int]
    values: dict[str, float]


def corners_of(height: int, width: int, side_px: int) -> list[tuple[int, int]]:
    """Return the first pixels (y, x) of whole patches, row by row, away from the border."""
    rows, columns = (
        range(BORDER_PX, side - BORDER_PX - side_px + 1, side_px) for side in (height, width)
    )
    return [(y, x) for y in rows for x in columns]


def measure_patches(
    scene: str,
    picture: FloatArray,
    truth: FloatArray,
    denied: Mapping[str, Array],
    side_px: int,
    perceptual: Measure,
) -> list[Patch]:
    """Measure every patch.

    Args:
        scene: Name of the picture.
        picture: (3, h, w) linear Rec.709.
        truth: (3, h, w) sRGB values.
        denied: `chi2`, `detail` and `excess`, (h, w): what `unexplained` gives, and how much more
            than of the filter alone the second is.
        side_px: Of a patch.
        perceptual: Gives (h, w) of two pictures of sRGB values.
    """
    got = encode_srgb(picture)
    difference = np.abs(got - truth).astype(np.float64)
    maps = {
        "l1": difference.mean(axis=0),
        "l2": np.square(difference).mean(axis=0),
        "perceptual": perceptual(got, truth),
        **denied,
    }
    overshoot = overshoot_of(got, truth)
    patches = []
    for y, x in corners_of(truth.shape[1], truth.shape[2], side_px):
        cut = np.s_[y : y + side_px, x : x + side_px]
        values = {name: _mean(plane[cut]) for name, plane in maps.items()}
        values["l2"] = float(np.sqrt(values["l2"]))
        values["overshoot"] = float(overshoot[cut].max())
        patches.append(Patch(scene=scene, place=(y, x), values=values))
    return patches


def overshoot_of(picture: FloatArray, truth: FloatArray) -> Array:
    """Return by how much a picture leaves the range of the truth around, (h, w); 0 inside it."""
    size = (1, 2 * REACH_PX + 1, 2 * REACH_PX + 1)
    above = picture - scipy.ndimage.maximum_filter(truth, size)
    below = scipy.ndimage.minimum_filter(truth, size) - picture
    return np.asarray(np.maximum(np.maximum(above, below), 0).max(axis=0), np.float64)


def summary(values: Array) -> dict[str, float | None]:
    """Return median, 95th and 99th percentile and maximum of what is known."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return dict.fromkeys(("median", "p95", "p99", "max"))
    figures = [*np.percentile(finite, (50, 95, 99)), finite.max()]
    return {
        name: round(float(v), 6)
        for name, v in zip(("median", "p95", "p99", "max"), figures, strict=True)
    }


def _mean(part: Array) -> float:
    finite = part[np.isfinite(part)]
    # a patch most of which is clipped says nothing
    return float(finite.mean()) if finite.size * 2 >= part.size else float("nan")

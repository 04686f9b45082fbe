"""Kernels of a camera by the distance of the scene, and a map of how near a scene is.

    kernels of known depths -> steps of 1 / distance between them --+-> kernels of every place
                                         map of 1 / distance -------+

Defocus is linear in 1 / distance, here called nearness.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.runtime.bank.psf import FieldKernels, FloatGrid
from camkit.units import MM_PER_M

INTERVALS: Final = 16
"""Between the steps that are tried, from the nearest to the farthest distance; about as many."""
KEPT_STEPS: Final = 4
"""Steps whose kernels are kept, since neighbouring blocks share them."""
MEAN: Final = -1
"""Number of the mean kernels, for places whose distance nothing tells."""
LEAST_NEARNESS: Final = 1e-9
"""In 1/mm; scenes that are farther count as 1000 km away."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NearnessMap:
    """The nearness of the scene, over a capture.

    Attributes:
        values: (rows, columns), 1 / distance in 1/mm; NaN where nothing tells it.
        first_px: Where the first lies, along rows and columns.
        step_px: How far neighbours are apart, likewise.
    """

    values: FloatGrid
    first_px: tuple[float, float]
    step_px: tuple[float, float]

    def at(self, x_px: float, y_px: float) -> float:
        """Return 1 / distance in 1/mm of a pixel position; linear between places that tell it.

        NaN where most of what lies around tells nothing.
        """
        import scipy.ndimage  # late: cameras of one distance need none of it

        places = zip((y_px, x_px), self.first_px, self.step_px, strict=True)
        where = [[(at - first) / step] for at, first, step in places]
        finite = np.isfinite(self.values)
        share, value = (
            float(scipy.ndimage.map_coordinates(plane, where, order=1, mode="nearest")[0])
            for plane in (finite.astype(np.float64), np.where(finite, self.values, 0.0))
        )
        return value / share if share > 0.5 else np.nan

    def to_json(self) -> dict[str, float]:
        """Return the distances in m that a sidecar keeps: nearest, usual and farthest.

        Empty where nothing tells any.
        """
        finite = self.values[np.isfinite(self.values)]
        if not finite.size:
            return {}
        far, middle, near = np.quantile(finite, (0, 0.5, 1))
        return {
            name: float(1 / max(nearness, LEAST_NEARNESS)) / MM_PER_M
            for name, nearness in (("nearest_m", near), ("median_m", middle), ("farthest_m", far))
        }

    def describe(self) -> str:
        """Return for people how far the scene was found to be."""
        distances = self.to_json()
        if not distances:
            return (
                "the object distance cannot be estimated from the capture: the mean kernels of all "
                f"distances are used; if you know the distance, add {option_text('depth_m')}"
            )
        near, middle, far = (
            f"{distances[name]:.3g}" for name in ("nearest_m", "median_m", "farthest_m")
        )
        spread = "" if near == far else f" ({near} to {far} m over the picture)"
        return f"object distance estimated from the capture: {middle} m{spread}"


class KernelsByDistance:
    """The kernels of a camera at as many distances as are told apart; safe to share.

    Kernels are linear in 1 / distance between the depths that are known, as
    `camkit.psf.depth_weights` has them.
    """

    def __init__(self, depths_mm: FloatGrid, kernels: Sequence[FieldKernels]) -> None:
        """Store the kernels of every depth.

        Args:
            depths_mm: (depth,), increasing; inf is allowed.
            kernels: Of every depth, of one shape.
        """
        depth_nearness = 1 / np.asarray(depths_mm, np.float64)
        self.nearness: FloatGrid = steps_between(depth_nearness[::-1])
        """(step,), increasing."""
        hats = [
            np.interp(self.nearness, depth_nearness[::-1], unit)
            for unit in np.eye(depth_nearness.size)[::-1]
        ]
        self.weights: FloatGrid = np.stack(hats, axis=1)
        """(step, depth): the share of every depth in the kernels of a step."""
        self._kernels = tuple(kernels)
        self.at_step = lru_cache(maxsize=KEPT_STEPS)(self._at_step)
        """Cached: the `FieldKernels` of a step, or of `MEAN`."""

    def step_of(self, nearness: float) -> int:
        """Return the step nearest to 1 / distance in 1/mm; `MEAN` for NaN."""
        if np.isnan(nearness):
            return MEAN
        return int(np.abs(self.nearness - nearness).argmin())

    def of_scene(self, scene: NearnessMap) -> "KernelsOfScene":
        """Return the kernels of the places of a capture, for a bank."""
        return KernelsOfScene(kernels=self, scene=scene)

    @property
    def depth_kernels(self) -> tuple[FieldKernels, ...]:
        """Return the kernels of every depth."""
        return self._kernels

    def _at_step(self, step: int) -> FieldKernels:
        even = np.full(len(self._kernels), 1 / len(self._kernels))
        weights = even if step == MEAN else self.weights[step]
        parts = [(w, k) for w, k in zip(weights, self._kernels, strict=True) if w > 0]
        if len(parts) == 1:
            return parts[0][1]
        mixed = sum(np.float32(weight) * kernels.kernels for weight, kernels in parts)
        return replace(parts[0][1], kernels=np.asarray(mixed, np.float32))


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelsOfScene:
    """The kernels of a scene; a `camkit.runtime.bank.blocks.KernelChoice`."""

    kernels: KernelsByDistance
    scene: NearnessMap

    def number_at(self, x_px: float, y_px: float) -> int:
        """Return the step of the distance at a pixel position of the capture, or `MEAN`."""
        return self.kernels.step_of(self.scene.at(x_px, y_px))

    def kernels_of(self, number: int) -> FieldKernels:
        """Return the kernels of a step."""
        return self.kernels.at_step(number)


def steps_between(nearness: FloatGrid) -> FloatGrid:
    """Return steps of 1 / distance, even between neighbouring known ones, which are steps too.

    Args:
        nearness: (depth,), increasing.
    """
    share = np.diff(nearness) / (nearness[-1] - nearness[0])
    counts = np.maximum(np.rint(INTERVALS * share), 1).astype(int)
    parts = [
        np.linspace(first, last, count, endpoint=False)
        for first, last, count in zip(nearness[:-1], nearness[1:], counts, strict=True)
    ]
    return np.concatenate([*parts, nearness[-1:]])

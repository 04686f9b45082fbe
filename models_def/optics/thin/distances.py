"""Core and haze of a lens at other object distances than that of its focus, for stress tests.

Every distance is frozen by itself, about its own peaks; few fields and wavelengths, since only what
changes with distance matters.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.models_def.optics.freeze import Facts, Tell
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.hazy_freezing import (
    COPY_RAYS,
    LEAST_FIELDS,
    HazyGrid,
    freeze_hazy,
)
from camkit.psf import depth_name

DISTANCES_MM: Final = (500.0, 1000.0, 2000.0, 4000.0, 10_000.0, math.inf)
COARSE: Final = HazyGrid(fields=LEAST_FIELDS, wavelengths=3, rays=COPY_RAYS)


def freeze_distances(
    lens: Lens,
    sensor: ColorSensor,
    *,
    distances_mm: tuple[float, ...] = DISTANCES_MM,
    grid: HazyGrid = COARSE,
    tell: Tell = lambda _: None,
) -> FrozenOptics:
    """Freeze a lens, focused as it is, for an object at its own distance and at others.

    Heights, distortion and illumination are those of its own distance; the middles of the other
    distances lie a few pixels beside it.

    Args:
        lens: With its grooves as they are.
        sensor: Size, pitch and response.
        distances_mm: Of the object, besides that of the lens.
        grid: How finely.
        tell: Takes a line for every distance.

    Returns:
        Optics of all distances, near to far. A distance at which the lens has no peaks while it
        has some at its own (or the other way round), or cannot be frozen, is left out.

    Raises:
        ContractError: As `freeze_hazy` of its own distance, or if no other is left.
    """

    def frozen(distance_mm: float) -> tuple[FrozenOptics, Facts]:
        return freeze_hazy(replace(lens, object_distance_mm=distance_mm), sensor, grid)

    own_mm = lens.object_distance_mm
    focused, of_own = frozen(own_mm)
    by_distance = {own_mm: focused}
    for distance_mm in (d for d in distances_mm if d != own_mm):
        try:
            optics, report = frozen(distance_mm)
        except ContractError as error:
            verdict = f"left out, {error}"
        else:
            middle = report["about"]
            verdict = "kept" if middle == of_own["about"] else f"left out, by its {middle}"
            if middle == of_own["about"]:
                by_distance[distance_mm] = optics
        tell(f"object at {depth_name(distance_mm)}: {verdict}")
    if len(by_distance) == 1:
        raise ContractError(f"{lens.name} is known at no other distance than its own")
    return _stacked({distance: by_distance[distance] for distance in sorted(by_distance)}, focused)


def _stacked(by_distance: dict[float, FrozenOptics], focused: FrozenOptics) -> FrozenOptics:
    """Stack distances side by side, with the places of one of them."""
    hazes = [optics.haze for optics in by_distance.values() if optics.haze is not None]
    assert focused.haze is not None
    side = max(haze.kernels.shape[-1] for haze in hazes)
    depths_mm = np.array(list(by_distance))

    def padded(kernels: FloatArray) -> FloatArray:
        margin = (side - kernels.shape[-1]) // 2
        return np.pad(kernels, [(0, 0)] * 3 + [(margin, margin)] * 2)

    psf = replace(
        focused.psf,
        kernels=np.concatenate([optics.psf.kernels for optics in by_distance.values()], axis=1),
        depths_mm=depths_mm,
    )
    haze = replace(
        focused.haze,
        kernels=np.concatenate([padded(haze.kernels) for haze in hazes], axis=1),
        core_share=np.concatenate([haze.core_share for haze in hazes], axis=1),
        depths_mm=depths_mm,
    )
    return FrozenOptics(psf=psf, haze=haze)

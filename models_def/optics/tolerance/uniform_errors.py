"""Fabricated copies whose every number is off by a uniform error, as networks are trained on."""

from dataclasses import dataclass, replace

import numpy as np

from camkit.models_def.optics.prescription import Lens, Surface, require_plain


@dataclass(frozen=True, slots=True, kw_only=True)
class FabricationErrors:
    """Half-widths of the uniform errors of a Monte-Carlo sample of the lens.

    Attributes:
        radius_relative: Relative error of the radius of every curved surface.
        thickness_mm: Error of every gap and thickness but the last one.
        index: Error of the index of every glass.
        focus_mm: Error of the distance to the sensor.
    """

    radius_relative: float = 0.002
    thickness_mm: float = 0.03
    index: float = 0.0005
    focus_mm: float = 0.02


def perturb(lens: Lens, errors: FabricationErrors, rng: np.random.Generator) -> Lens:
    """Return a fabricated copy of a lens: every number off by a uniform error.

    An element keeps one index throughout. Lenses given by f-number should first be fixed by
    `pupil.with_fixed_stop`, or the stop follows the focal length.

    Args:
        lens: The nominal lens.
        errors: Half-widths.
        rng: Draws, in a fixed order of surfaces.

    Raises:
        ContractError: If the lens has configurations.
    """
    require_plain(lens, "a fabricated copy")
    copies: list[Surface] = []
    for i, surface in enumerate(lens.surfaces):
        radius, thickness, index = rng.uniform(-1, 1, 3)
        last = i == len(lens.surfaces) - 1
        width_mm = errors.focus_mm if last else errors.thickness_mm
        # a glass ends at the next surface, so one offset per surface is one per element
        offset = 0.0 if surface.glass == "air" else float(index) * errors.index
        copies.append(
            replace(
                surface,
                curvature_per_mm=surface.curvature_per_mm
                / (1 + float(radius) * errors.radius_relative),
                thickness_mm=surface.thickness_mm + float(thickness) * width_mm,
                index_offset=surface.index_offset + offset,
            )
        )
    return replace(lens, surfaces=tuple(copies))

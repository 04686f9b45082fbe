"""Choice of the level that is etched deepest.

The choice does not change a plate as designed, only one with errors of fabrication. Phases repeat,
so any level may be the bottom: all cells move on by as many levels, and the dots stay as they are.
Masks that etch too deep by a share then make other errors. Above all they send light straight on,
and this light meets that of the middle dot, in phase or against it.
"""

from typing import Final

import numpy as np

from camkit.models_def.optics.dots.target import FloatGrid, likeness
from camkit.models_def.optics.dots.unit import DotPlate, phase_light

DEPTH_ERROR: Final = 0.02
"""Of all masks, too deep and not deep enough, that the bottom is chosen for."""


def best_bottom(plate: DotPlate, target: FloatGrid) -> DotPlate:
    """Return the plate of the same dots that wrong depths spoil least.

    Args:
        plate: With any bottom.
        target: (11, 11), the PSF that is wanted.
    """
    turned = [
        DotPlate(
            camera=plate.camera, level=(plate.level + rise) % plate.levels, levels=plate.levels
        )
        for rise in range(plate.levels)
    ]
    return min(turned, key=lambda one: _error(one, target))


def _error(plate: DotPlate, target: FloatGrid) -> float:
    """Return the larger RMSE of the dots of a plate etched too deep and not deep enough."""
    turns_per_um = (plate.camera.index - 1) / plate.camera.wavelength_um
    masks = plate.etching.masks
    return max(
        likeness(phase_light(2 * np.pi * turns_per_um * made_um), target).rmse
        for made_um in (plate.etched_um((e,) * masks) for e in (-DEPTH_ERROR, DEPTH_ERROR))
    )

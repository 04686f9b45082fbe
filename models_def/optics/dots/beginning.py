"""Choice of the phase at which the period of a dot pattern begins.

The phase does not change the dots, only the light between them. A plate of few units has wide dots.
Their feet overlap in the active areas, brighter or darker by their phases, and the place where the
period begins turns these. So the place is chosen, at no cost.
"""

from typing import Final

import numpy as np

from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.pattern import View
from camkit.models_def.optics.dots.target import FloatGrid, likeness

PLACES: Final = 8
"""Tried along a side."""
FEW_TILES: Final = 4
"""Units that a beginning is judged by: the feet of dots fall as the units grow, in the same
proportion everywhere."""


def best_beginning(height_um: FloatGrid, camera: DotCamera, target: FloatGrid) -> tuple[int, int]:
    """Return by how many cells (down, right) to roll a unit, for the least error of its PSF.

    Args:
        height_um: (cells, cells) of one unit.
        camera: What it stands in.
        target: (11, 11), the PSF that is wanted.
    """
    view = View(tiles=min(FEW_TILES, camera.tiles))
    steps = np.unique(np.arange(PLACES) * camera.cells // PLACES).tolist()

    def error(begin: tuple[int, int]) -> float:
        light = effective_psf(np.roll(height_um, begin, (0, 1)), camera, view)
        return likeness(light, target).rmse

    return min(((down, right) for down in steps for right in steps), key=error)

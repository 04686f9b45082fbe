"""The effective PSF of a pattern of dots as small pixels see it, which training is given.

A pixel sees a round area. The value of the PSF at an offset of so many sub-pixels is the share of a
point's light that falls into this area: the pattern summed over circles on its lattice.

    dots, tens of samples a sub-pixel -> circles on the lattice, turned if need be -> (side, side)

References: Sun 2021, section 4.3.3 (phase mask tiling) and figure 4.5c.
"""

import math
from typing import Final

import numpy as np

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.dots.camera import ORDERS, DotCamera
from camkit.models_def.optics.dots.pattern import FOCUSED, View, dot_picture
from camkit.models_def.optics.dots.target import FloatGrid

SAMPLES: Final = 33
"""Of the pattern per sub-pixel, odd: two for the finest fringes of 16 units, 2.34 um."""


def effective_psf(
    height_um: FloatGrid, camera: DotCamera, view: View = FOCUSED, side: int = ORDERS
) -> FloatGrid:
    """Return the PSF that an array of small pixels sees through a plate.

    Args:
        height_um: (cells, cells) heights in um of one unit, as it is made.
        camera: Laser, lens, lattice, active area.
        view: How the plate stands.
        side: Sub-pixels along a side, odd. More than 11 show the light beside the dots.

    Returns:
        (side, side) shares of the light that the aperture lets through; divided by its sum it is
        the kernel of a sampling.

    Raises:
        ContractError: If `dot_picture` refuses, or a side is even.
    """
    if side < 1 or side % 2 == 0:
        raise ContractError(f"side must be odd; got {side}")
    tiles = camera.tiles if view.tiles is None else view.tiles
    samples = max(SAMPLES, 2 * tiles + 1)
    reach = abs(math.cos(view.turn_rad)) + abs(math.sin(view.turn_rad))
    count = 2 * math.ceil((side * reach) / 2) + 1
    pitch_um = camera.spacing_um / samples
    grid = PixelGrid(side_px=count * samples, pitch_um=pitch_um, samples=1)
    light = dot_picture(height_um, camera, grid, view)
    return seen_by_circles(light, pitch_um, camera, side, view.turn_rad)


def seen_by_circles(
    light: FloatGrid, pitch_um: float, camera: DotCamera, side: int, turn_rad: float = 0.0
) -> FloatGrid:
    """Sum light over the active areas of a lattice of sub-pixels about its middle.

    Args:
        light: (n, n), n odd, on pixels far smaller than the active area.
        pitch_um: Of its pixels.
        camera: Spacing and active area.
        side: Sub-pixels along a side, odd.
        turn_rad: Of the light, from +x to +y: the lattice is turned the other way.
    """
    place_um = (np.arange(light.shape[0]) - light.shape[0] // 2) * pitch_um
    steps_um = (np.arange(side) - side // 2) * camera.spacing_um
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    light_sums = np.zeros((side, side))
    for row, y_um in enumerate(steps_um):
        for column, x_um in enumerate(steps_um):
            down_um, right_um = cos * y_um - sin * x_um, cos * x_um + sin * y_um
            rows, columns = (_near(place_um, at, camera.active_um) for at in (down_um, right_um))
            away_um = np.hypot(place_um[rows, None] - down_um, place_um[None, columns] - right_um)
            # pixels at the rim count by how far they lie inside
            inside = np.clip((camera.active_um / 2 - away_um) / pitch_um + 0.5, 0, 1)
            light_sums[row, column] = (light[rows, columns] * inside).sum()
    return light_sums


def _near(place_um: FloatGrid, at_um: float, width_um: float) -> slice:
    """Return the places that a circle can reach."""
    first, last = np.searchsorted(place_um, [at_um - width_um, at_um + width_um])
    return slice(int(first), int(last))

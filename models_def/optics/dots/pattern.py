"""The dots of a plate through its real aperture: units side by side, in focus and out.

The plate lies in the front focal plane. A point at distance d before it reaches the plate with the
phase pi r^2 / (lambda d), the lens transforms the field, and a sensor that is moved by s from the
back focal plane adds -pi s r^2 / (lambda f^2) of the frequency r / (lambda f). Together

    U(x) = sum of t(r) exp(i pi r^2 (1 / d - s / f^2) / lambda) exp(-2 pi i x r / (lambda f))

so dots keep their distance from one another whatever the sensor is focused at (s = f^2 / d), and
what is left of a wrong focus is a curvature. It is carried to the sensor by `plate_psf`, which
knows nothing of periods: with as many cells as the whole plate has.

References: Goodman 2005, Introduction to Fourier optics, section 5.2; Sun 2021, eq. (4.7).
"""

import math
from dataclasses import dataclass

import numpy as np
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Aperture, Bench
from camkit.models_def.optics.diffraction.wave import PixelGrid, plate_psf
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.target import FloatGrid
from camkit.units import UM_PER_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The place of a plate before its sensor.

    Attributes:
        tiles: Units along a side of the aperture; None for the camera's.
        aperture: Its shape; a circle is as wide as the square.
        defocus_mm: By which the sensor lies behind the place where the point is sharp.
        shift_mm: (y, x) of the plate before the aperture, taken to whole cells.
        turn_rad: Of the plate, from +x to +y.
    """

    tiles: int | None = None
    aperture: Aperture = "square"
    defocus_mm: float = 0.0
    shift_mm: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no place.

        Raises:
            ContractError: If so.
        """
        numbers = (self.defocus_mm, *self.shift_mm, self.turn_rad)
        if not all(math.isfinite(number) for number in numbers):
            raise ContractError(f"defocus, shift and turn must be finite; got {numbers}")
        if self.tiles is not None and self.tiles < 1:
            raise ContractError(f"tiles must be >= 1; got {self.tiles}")


FOCUSED = View()


def dot_picture(
    height_um: FloatGrid, camera: DotCamera, grid: PixelGrid, view: View = FOCUSED
) -> FloatGrid:
    """Return the light of a point on a sensor, in the axes of the plate: its turn is left out.

    Args:
        height_um: (cells, cells) of one unit, as it is made.
        camera: Laser, lens, lattice.
        grid: Pixels, the middle one on the axis.
        view: How the plate stands.

    Returns:
        (side, side), shares of the light that the aperture lets through.

    Raises:
        ContractError: If the heights are not of this camera, or the light at the rim is too steep
            for its cells, as far out of focus.
    """
    if height_um.shape != (camera.cells, camera.cells):
        raise ContractError(
            f"one unit has {camera.cells}x{camera.cells} cells; got {height_um.shape}"
        )
    tiles = camera.tiles if view.tiles is None else view.tiles
    whole = np.tile(height_um, (tiles, tiles))
    steps = [round(part * UM_PER_MM / camera.cell_um) for part in view.shift_mm]
    bench = Bench(
        diameter_mm=tiles * camera.unit_mm,
        aperture=view.aperture,
        focal_length_mm=camera.focal_length_mm,
        lens_phase="parabolic",
        kernel="parabolic",
    )
    curvature = -view.defocus_mm / camera.focal_length_mm**2
    with torch.no_grad():
        light = plate_psf(
            torch.from_numpy(np.roll(whole, steps, (0, 1))),
            camera.index,
            camera.wavelength_um,
            bench=bench,
            grid=grid,
            # light that runs together has a source behind the plate
            depth_mm=math.inf if curvature == 0 else 1 / curvature,
        )
    return np.asarray(light.numpy())

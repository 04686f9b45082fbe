"""The dots of a plate, photographed finely, to the PSF that an array of small pixels sees.

    photograph of a point through the plate, pixels of some um
      -> where the lattice of dots lies, by the phase of its period
      -> light in a circle about every place of the lattice: the active area of a pixel
      -> the places that look most like the PSF that was designed -> sum 1

Only the place of the lattice is fitted. Its period is that of the array's sub-pixels, not of the
dots: what a wrong lens or distance does to them is what the array sees of them, too. Which dot is
the middle one, nothing but the design tells.

References: Sun 2021, section 4.5.1 and figure 4.5.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.lattice import FloatGrid
from camkit.calibration.measured import MeasuredPsf
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.psf import FrozenPsf

FINE: Final = 8
"""Parts of a pixel, along either axis, that lie inside a circle or outside."""
LEAST_PIXELS: Final = 3.0
"""Across the active area, for circles to be summed over."""
LEAST_MODULATION: Final = 0.2
"""Of light at the period of the lattice, below which there are no dots."""
LEAST_LIGHT: Final = 0.1
SPACING_UM: Final = 37.5
ACTIVE_UM: Final = 30.0
"""Both of the prototype of the thesis."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenDots:
    """The PSF of an array, out of a photograph of dots.

    Attributes:
        kernel: (side, side) float64 of unit sum.
        place_um: (y, x) of its middle from that of the photograph.
        share: Of the light of the photograph in the circles.
        modulation: How much the light keeps to the lattice, 0 to 1, the lesser of both axes.
        likeness: Cosine of the angle between it and the design, 1 at best.
    """

    kernel: FloatGrid
    place_um: tuple[float, float]
    share: float
    modulation: float
    likeness: float

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "place_um": [round(part, 3) for part in reversed(self.place_um)],
            "share": round(self.share, 5),
            "modulation": round(self.modulation, 4),
            "likeness": round(self.likeness, 6),
        }


def see_dots(
    light: NDArray[np.floating],
    pixel_pitch_um: float,
    designed: NDArray[np.floating],
    *,
    spacing_um: float = SPACING_UM,
    active_um: float = ACTIVE_UM,
) -> SeenDots:
    """Sum a photograph of dots over the active areas of an array.

    Args:
        light: (h, w) linear, background taken off; beyond it it is dark.
        pixel_pitch_um: Of its pixels.
        designed: (side, side) PSF that the plate was made for, of any sum > 0.
        spacing_um: Of the array's sub-pixels.
        active_um: Diameter of the round area of its pixels that sees.

    Raises:
        ContractError: If pixels are too coarse for the active area, or light is not finite.
        DecodeError: If there are no dots of this period, or no light.
    """
    image = np.asarray(light, dtype=np.float64)
    if image.ndim != 2 or not np.isfinite(image).all():
        raise ContractError(f"a photograph of dots must be finite (h, w); got {image.shape}")
    if not 0 < pixel_pitch_um * LEAST_PIXELS <= active_um:
        raise ContractError(
            f"pixels of {pixel_pitch_um:g} um are too coarse for active areas of {active_um:g} "
            f"um; photograph the dots with pixels of at most {active_um / LEAST_PIXELS:g} um"
        )
    total = float(image.sum())
    if total <= 0:
        raise DecodeError("a photograph of dots needs light")
    side = designed.shape[0]
    lines = [_line(image.sum(1 - n), pixel_pitch_um, spacing_um, side) for n in (0, 1)]
    modulation = min(line[1] for line in lines)
    if modulation < LEAST_MODULATION:
        raise DecodeError(
            f"no dots every {spacing_um:g} um: the light keeps to that period by {modulation:.2f} "
            f"of 1; photograph the plate in focus, or check {option_text('pixel_pitch_um')}"
        )
    rows, columns = (line[0] for line in lines)
    circles = _circles(
        image, rows / pixel_pitch_um, columns / pixel_pitch_um, active_um / 2 / pixel_pitch_um
    )
    (row, column), likeness = _most_like(np.maximum(circles, 0), designed)
    kernel = np.maximum(circles[row : row + side, column : column + side], 0)
    return SeenDots(
        kernel=kernel / kernel.sum(),
        place_um=(float(rows[row + side // 2]), float(columns[column + side // 2])),
        share=float(kernel.sum() / total),
        modulation=modulation,
        likeness=likeness,
    )


def dots_psf(
    measured: MeasuredPsf, designed: FrozenPsf, active_um: float = ACTIVE_UM
) -> tuple[FrozenPsf, SeenDots]:
    """Return the PSF of an array out of a point measured on fine pixels, see `measure_psf`.

    Args:
        measured: The point through the plate. Its red is taken as it lies on the sensor: dots
            narrower than a pixel would ring if they were resampled.
        designed: The PSF that the plate was made for, on the array's sub-pixels.
        active_um: Diameter of the round area of a pixel that sees.

    Returns:
        The designed PSF with the kernel that was seen, as `camkit train` takes it; and what was
        seen.

    Raises:
        ContractError: If the designed PSF is not one kernel, or pixels are too coarse.
        DecodeError: If there are no dots.
    """
    shape = designed.kernels.shape
    if shape[:3] != (1, 1, 1) or shape[3] != shape[4] or designed.symmetry != "uniform":
        raise ContractError(
            "the PSF that a plate was made for must be one square kernel, the same everywhere; "
            f"got {shape}, {designed.symmetry}"
        )
    if measured.red is None:
        raise ContractError(
            f"dots are seen by the light of a point; leave {option_text('disc_px')} and "
            f"{option_text('edge')} out"
        )
    dots = see_dots(
        measured.red.light,
        measured.red.pitch_um,
        designed.kernels[0, 0, 0],
        spacing_um=designed.pixel_pitch_um,
        active_um=active_um,
    )
    kernels = np.ascontiguousarray(dots.kernel[None, None, None], dtype=np.float32)
    return replace(designed, kernels=kernels, depths_mm=measured.psf.depths_mm), dots


def _line(
    profile: FloatGrid, pitch_um: float, spacing_um: float, side: int
) -> tuple[FloatGrid, float]:
    """Return the places of the lattice along one axis, in um from the middle, and the modulation.

    The lattice goes on beyond the photograph, so that few dots find their place in a wide PSF.
    """
    at_um = (np.arange(profile.size) - (profile.size - 1) / 2) * pitch_um
    turns = np.sum(profile * np.exp(2j * np.pi * at_um / spacing_um))
    first_um = float(np.angle(turns)) / (2 * np.pi) * spacing_um
    reach = int(np.ceil(at_um[-1] / spacing_um)) + side
    places_um = first_um + np.arange(-reach, reach + 1, dtype=np.float64) * spacing_um
    return places_um, float(np.abs(turns) / np.abs(profile).sum())


def _circles(image: FloatGrid, rows: FloatGrid, columns: FloatGrid, radius: float) -> FloatGrid:
    """Return the light (row, column) of a circle about every place; all in pixels."""
    down, right = (
        places + (n - 1) / 2 for places, n in zip((rows, columns), image.shape, strict=True)
    )
    return np.array([[_circle(image, y, x, radius) for x in right] for y in down])


def _circle(image: FloatGrid, y: float, x: float, radius: float) -> float:
    """Return the light of one circle; pixels at its rim count by the share of them inside."""
    top, left = (max(0, int(np.floor(at - radius))) for at in (y, x))
    part = image[top : max(0, int(y + radius) + 2), left : max(0, int(x + radius) + 2)]
    if part.size == 0:
        return 0.0
    down, across = (
        (np.arange(n * FINE) + 0.5) / FINE - 0.5 + first - at
        for n, first, at in zip(part.shape, (top, left), (y, x), strict=True)
    )
    inside = np.hypot(down[:, None], across[None, :]) <= radius
    shares = inside.reshape(part.shape[0], FINE, part.shape[1], FINE).mean((1, 3))
    return float((part * shares).sum())


def _most_like(circles: FloatGrid, designed: NDArray[np.floating]) -> tuple[tuple[int, int], float]:
    """Return the first (row, column) of the window most like a PSF, and the likeness."""
    unit_psf = designed / np.sqrt(np.square(designed, dtype=np.float64).sum())
    windows = np.lib.stride_tricks.sliding_window_view(circles, unit_psf.shape)
    sizes = np.sqrt((windows**2).sum((-2, -1)))
    # of windows with next to no light a few dots could look like anything
    alike = (windows * unit_psf).sum((-2, -1)) / np.maximum(sizes, LEAST_LIGHT * sizes.max())
    row, column = np.unravel_index(int(alike.argmax()), alike.shape)
    return (int(row), int(column)), float(alike[row, column])

"""The PSF of a plate: its height map carried to the sensor's pixels by one Fourier transform.

    height (um) -> phase by the index of its glass -> times what source, lens and way leave over
    -> the sensor, integrated over pixels, per wavelength

The plate is made of square cells of equal height, as it is etched. Intensities are shares of the
light that the aperture lets through: a window that does not hold all of it sums to less than 1.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.chirp_z import zoom_fourier_2d
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.units import UM_PER_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelGrid:
    """The samples at which the PSF is computed.

    Attributes:
        side_px: Odd; the middle pixel lies on the axis.
        pitch_um: Of the pixels.
        samples: Per pixel and axis; None for as many as the light can vary (Nyquist).
    """

    side_px: int
    pitch_um: float
    samples: int | None = None

    def __post_init__(self) -> None:
        """Refuse a grid without a middle.

        Raises:
            ContractError: If so.
        """
        if self.side_px < 1 or self.side_px % 2 == 0 or not self.pitch_um > 0:
            raise ContractError(f"side_px must be odd and pitch_um > 0; got {self}")
        if self.samples is not None and self.samples < 1:
            raise ContractError(f"samples must be >= 1; got {self.samples}")


def pupil(bench: Bench, cells: int) -> Tensor:
    """Return the amplitude (cells, cells) of the aperture; cells at its rim let part of it through.

    Args:
        bench: Its diameter is `cells` wide.
        cells: Of the plate along one side.
    """
    if bench.aperture == "square":
        return torch.ones(cells, cells, dtype=torch.float64)
    return _circle(cells).clone()


@lru_cache(maxsize=4)  # asked for at every wavelength and depth
def _circle(cells: int) -> Tensor:
    fine = 8
    place = (torch.arange(cells * fine, dtype=torch.float64) + 0.5) / fine - cells / 2
    squares = place.reshape(cells, fine) ** 2
    share = torch.zeros(cells, cells, dtype=torch.float64)
    for i in range(fine):
        for j in range(fine):
            share += (squares[:, None, i] + squares[None, :, j] <= (cells / 2) ** 2).double()
    return share / fine**2


def plate_psf(
    height_um: Tensor,
    index: float,
    wavelength_um: float,
    *,
    bench: Bench,
    grid: PixelGrid,
    depth_mm: float = math.inf,
    amplitude: Tensor | None = None,
) -> Tensor:
    """Return the PSF of a plate at one wavelength; gradients flow to the heights.

    Args:
        height_um: (cells, cells), rows downwards; the diameter of the aperture is its side. A
            height of more than a cycle need not be wrapped.
        index: Of refraction of the plate at the wavelength, in air.
        wavelength_um: Of the light.
        bench: Lens, sensor, aperture.
        grid: Pixels.
        depth_mm: Distance of the point light, on the axis.
        amplitude: (cells, cells) of the aperture; None for that of the bench.

    Returns:
        (side, side), shares of the light; precise to about 1e-6 of the peak for heights in float32,
        1e-12 in float64.

    Raises:
        ContractError: If the plate has too few cells for the light at its rim, or for the window.

    References: Sun 2021, eq. (2.6) to (2.9).
    """
    cells = _side(height_um)
    cell_mm = bench.diameter_mm / cells
    wave_mm = wavelength_um / UM_PER_MM
    _check_sampling(bench, grid, cell_mm, wave_mm, depth_mm)
    samples = grid.samples or _needed_samples(bench, grid, wave_mm)
    light = (pupil(bench, cells) if amplitude is None else amplitude).to(height_um.dtype)
    field = _field(height_um, index, wavelength_um, bench, depth_mm, light)
    step_mm = grid.pitch_um / UM_PER_MM / samples
    step = cell_mm * step_mm / (wave_mm * bench.distance_mm)
    fine = grid.side_px * samples
    psf = zoom_fourier_2d(field, step, fine).abs() ** 2
    # a cell is a square, not a point: its own diffraction lies over that of the grid of cells
    cell_factor = torch.sinc((torch.arange(fine, dtype=torch.float64) - (fine - 1) / 2) * step)
    cell_factor = (cell_factor**2).to(psf.dtype)
    psf = psf * cell_factor[:, None] * cell_factor[None, :] * (step**2 / (light**2).sum())
    return psf.reshape(grid.side_px, samples, grid.side_px, samples).sum((1, 3))


def strehl(
    height_um: Tensor, index: float, wavelength_um: float, *, bench: Bench, depth_mm: float
) -> float:
    """Return the light in the middle of the PSF over that of an aperture of even phase.

    Args:
        height_um: (cells, cells).
        index: Of refraction of the plate at the wavelength, in air.
        wavelength_um: Of the light.
        bench: Lens, sensor, aperture.
        depth_mm: Distance of the point light, on the axis.
    """
    light = pupil(bench, _side(height_um)).to(height_um.dtype)
    with torch.no_grad():
        field = _field(height_um, index, wavelength_um, bench, depth_mm, light)
    return float(field.to(torch.complex128).sum().abs() ** 2 / light.double().sum() ** 2)


def _field(
    height_um: Tensor,
    index: float,
    wavelength_um: float,
    bench: Bench,
    depth_mm: float,
    light: Tensor,
) -> Tensor:
    """Return field (cells, cells) behind the plate, less the phase of the sphere to the axis."""
    cells = height_um.shape[0]
    places = (torch.arange(cells, dtype=torch.float64) - (cells - 1) / 2) * (
        bench.diameter_mm / cells
    )
    r2_mm = places[:, None] ** 2 + places[None, :] ** 2
    path = bench.path_mm(r2_mm, depth_mm) * UM_PER_MM / wavelength_um
    rest = torch.remainder(path, 1.0)
    cycles = rest.to(height_um.dtype) + (index - 1) / wavelength_um * height_um
    return torch.polar(light.expand_as(cycles).contiguous(), 2 * math.pi * cycles)


def _side(height_um: Tensor) -> int:
    if height_um.ndim != 2 or height_um.shape[0] != height_um.shape[1]:
        raise ContractError(f"a height map is a square; got {tuple(height_um.shape)}")
    if not height_um.is_floating_point():
        raise ContractError(f"heights are real numbers; got {height_um.dtype}")
    return int(height_um.shape[0])


def _needed_samples(bench: Bench, grid: PixelGrid, wave_mm: float, fringes: float = 2.0) -> int:
    """Return the samples per pixel that the finest fringes of the light need, two for each."""
    fringe_mm = wave_mm * bench.distance_mm / bench.diameter_mm
    return max(1, math.ceil(fringes * grid.pitch_um / UM_PER_MM / fringe_mm))


def _check_sampling(
    bench: Bench, grid: PixelGrid, cell_mm: float, wave_mm: float, depth_mm: float
) -> None:
    """Refuse cells that are too wide.

    Raises:
        ContractError: Naming the limit.
    """
    steep = bench.steepest(depth_mm)
    if steep * cell_mm > wave_mm / 2:
        raise ContractError(
            f"cells of {cell_mm * UM_PER_MM:.2f} um are too wide for the light at the rim at "
            f"{wave_mm * UM_PER_MM:.3f} um: at most {wave_mm / 2 / steep * UM_PER_MM:.2f} um"
        )
    least = _needed_samples(bench, grid, wave_mm, 1.0)
    if grid.samples is not None and grid.samples < least:
        # sums of light over pixels hold with one sample a fringe, and not with fewer
        raise ContractError(
            f"{grid.samples} samples per pixel are too few for the finest fringes of the light at "
            f"{wave_mm * UM_PER_MM:.3f} um: at least {least}"
        )
    half_mm = grid.side_px * grid.pitch_um / 2 / UM_PER_MM
    reach_mm = wave_mm * bench.distance_mm / (2 * cell_mm)
    if half_mm > reach_mm * (1 + 1e-9):
        most_px = int(2 * reach_mm * UM_PER_MM / grid.pitch_um)
        raise ContractError(
            f"cells of {cell_mm * UM_PER_MM:.2f} um reach {reach_mm:.3f} mm to each side at "
            f"{wave_mm * UM_PER_MM:.3f} um: side_px is {most_px} at most"
        )

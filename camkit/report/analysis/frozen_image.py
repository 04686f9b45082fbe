"""Images of points as frozen optics have them: a core kernel, and where there is one its haze."""

from collections.abc import Callable
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.report.analysis.point_image import (
    DIRECTIONS,
    FAR_PX,
    NEAR_PX,
    Array,
    Band,
    Direction,
    PointImage,
    find_peak,
)
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.bank.psf import color_kernels
from camkit.units import to_mm

_PARTS: Final = 8
"""Of the side of a cell, whose light is even."""
LEAST_APART_UM: Final = 1e-6
Lookup = Callable[[float, float], FloatArray]


def frozen_images(
    optics: FrozenOptics,
    band: Band,
    heights_mm: Array,
    *,
    depth_mm: float | None = None,
    angle_at: Callable[[float], float | None] = lambda _: None,
) -> list[PointImage]:
    """Return the images of points.

    Args:
        optics: Kernels, and the haze beside them.
        band: Colour of the points.
        heights_mm: (n,) along +y; along the diagonal of optics whose kernels lie on a grid.
        depth_mm: Object distance; None where there is one.
        angle_at: Gives the field angle of a height in radians, or None.

    Raises:
        ContractError: If kernels of several depths are not known for this one, or nothing is known
            of a single wavelength.
    """
    psf, response = optics.psf, (band.wavelengths_um, band.weights[None])
    _check_wavelength(band, psf.wavelengths_um)
    haze: Lookup | None = None
    if optics.haze is None:
        kernels = color_kernels(psf, *response, depth_mm=depth_mm)
        share: Callable[[float, float], FloatArray] | None = None
    else:
        hazy = hazy_kernels(psf, optics.haze, *response, depth_mm=depth_mm)
        kernels, haze, share = hazy.core, hazy.haze.outward, hazy.coarse_core.light_at
    cell_px = 1 if optics.haze is None else optics.haze.cell_px
    images = []
    for height_mm in heights_mm:
        place = _place(float(height_mm), on_grid=psf.symmetry == "grid")
        core_share = 1.0 if share is None else float(share(*place)[0])
        peak = core_share * kernels.outward(*place)[0].astype(np.float64)
        cells = None if haze is None else haze(*place)[0].astype(np.float64)
        images.append(
            _image(
                peak,
                cells,
                cell_px,
                height_mm=float(height_mm),
                angle_rad=angle_at(float(height_mm)),
                illumination=float(kernels.interpolate(psf.relative_illumination, *place)),
            )
        )
    return images


def _check_wavelength(band: Band, known_um: Array) -> None:
    if band.wavelengths_um.size > 1:
        return
    wavelength_um = float(band.wavelengths_um[0])
    if not known_um.min() - LEAST_APART_UM <= wavelength_um <= known_um.max() + LEAST_APART_UM:
        raise ContractError(
            f"these optics are known from {known_um.min():g} to {known_um.max():g} um; nothing is "
            f"known at {wavelength_um:g} um"
        )


def _place(height_mm: float, *, on_grid: bool) -> tuple[float, float]:
    if not on_grid:
        return 0.0, height_mm
    return height_mm * np.sqrt(0.5), height_mm * np.sqrt(0.5)


def _image(
    core: Array,
    cells: Array | None,
    cell_px: int,
    *,
    height_mm: float,
    angle_rad: float | None,
    illumination: float,
) -> PointImage:
    """Join core and cells about the peak of the core; all light of both is 1."""
    total = core.sum() + (0.0 if cells is None else cells.sum())
    core = core / total
    peak = find_peak(core)
    shift_px = peak.row - core.shape[0] // 2, peak.column - core.shape[1] // 2
    down, across = (np.arange(side) for side in core.shape)
    distance = np.hypot(down[:, None] - peak.row, across - peak.column)
    near, far = (float(core[distance < radius].sum()) for radius in (NEAR_PX, FAR_PX))
    lines: dict[Direction, Array] = {
        name: _centred(core.sum(axis=1 - along), shift_px[along])
        for along, name in enumerate(DIRECTIONS)
    }
    patch = peak.patch
    if cells is not None:
        cells = cells / total
        near += within_cells(cells, cell_px, shift_px, NEAR_PX)
        far += within_cells(cells, cell_px, shift_px, FAR_PX)
        for along, name in enumerate(DIRECTIONS):
            spread = _in_pixels(cells.sum(axis=1 - along), cell_px, shift_px[along])
            lines[name] = _sum(lines[name], spread)
        patch = patch + cells[cells.shape[0] // 2, cells.shape[1] // 2] / cell_px**2
    return PointImage(
        height_mm=height_mm,
        field_angle_rad=angle_rad,
        patch=patch,
        lines=lines,
        near_share=near,
        far_share=far,
        illumination=illumination,
    )


def within_cells(cells: Array, cell_px: int, off_px: tuple[int, int], radius_px: float) -> float:
    """Return the light of cells, each even, within a radius of a place beside their middle.

    Args:
        cells: (n, n) light, n odd.
        cell_px: Side of a cell.
        off_px: (rows, columns) of the place from the middle.
        radius_px: Of the disc.
    """
    side = cells.shape[0]
    part = (np.arange(side * _PARTS) + 0.5) / _PARTS - side / 2
    down, across = (part * cell_px - shift_px for shift_px in off_px)
    inside = np.hypot(down[:, None], across) < radius_px
    shares = inside.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3))
    return float((cells * shares).sum())


def _centred(line: Array, off_px: int) -> Array:
    """Return a line with zeros added so that its peak lies in the middle."""
    return np.pad(line, (max(-2 * off_px, 0), max(2 * off_px, 0)))


def _in_pixels(cells: Array, cell_px: int, off_px: int) -> Array:
    """Return light by pixel of light by cell, linear between the middles of the cells."""
    reach = (cells.size // 2 + 1) * cell_px
    at = np.arange(-reach, reach + 1)
    middles = (np.arange(cells.size + 2) - (cells.size // 2 + 1)) * cell_px
    line = np.interp(at, middles, np.pad(cells, 1)) / cell_px
    return _centred(line, off_px)


def _sum(one: Array, other: Array) -> Array:
    """Add two lines of odd lengths, middle upon middle."""
    short, long = sorted((one, other), key=lambda line: line.size)
    margin = (long.size - short.size) // 2
    return long + np.pad(short, margin)


def sensor_heights_mm(sensor: ColorSensor, fields: int) -> Array:
    """Return heights from the axis to the sensor's corner, evenly spaced."""
    extent = sensor.known_extent
    corner_px = float(np.hypot(extent.width_px, extent.height_px)) / 2
    return np.linspace(0.0, corner_px * to_mm(extent.pixel_pitch_um), fields)

"""Positions of kernels over the field, as options or files state them."""

from dataclasses import dataclass

import numpy as np

from camkit.calibration.psf_import.kernel_stack import (
    FloatGrid,
    ImportOptions,
    KernelStack,
)
from camkit.caller import option_text
from camkit.psf import FrozenPsf, Symmetry, grid_heights_mm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Positions in mm from the optical axis.

    Attributes:
        symmetry: As of a frozen PSF.
        heights_mm: (field,).
        x_mm: (column,) of a grid.
        y_mm: (row,) of a grid.
    """

    symmetry: Symmetry
    heights_mm: FloatGrid
    x_mm: FloatGrid | None = None
    y_mm: FloatGrid | None = None


def places_of(stack: KernelStack, options: ImportOptions) -> tuple[Places | None, list[str]]:
    """Return the places of a stack, and every fault of what is stated of them."""
    rows, columns = stack.values.shape[:2]
    place_options = _place_options(options)
    if rows == columns == 1:
        if place_options:
            return None, [f"one kernel is the same all over the picture; leave {place_options} out"]
        return Places(symmetry="uniform", heights_mm=np.zeros(1)), []
    heights = options.heights_mm if options.heights_mm is not None else stack.heights_mm
    if heights is not None:
        return _radial(np.array(heights, dtype=np.float64), rows * columns)
    if not place_options:
        return None, [
            f"{rows} x {columns} kernels need places: {option_text('span_mm')} WIDTHxHEIGHT from "
            f"the first to the last, {option_text('frame_mm')} WIDTHxHEIGHT of the whole picture, "
            f"or {option_text('x_mm')} and {option_text('y_mm')}"
        ]
    return _grid(options, rows, columns)


def reach_note(psf: FrozenPsf, width_mm: float, height_mm: float) -> str | None:
    """Return a note on kernels whose places do not fit a sensor; None if they do.

    Args:
        psf: Any; only those of a grid and of several heights have places.
        width_mm: Of the sensor.
        height_mm: Likewise.
    """
    if psf.grid_x_mm is None or psf.grid_y_mm is None:
        axes = [(psf.field_heights_mm, float(np.hypot(width_mm, height_mm)) / 2)]
    else:
        axes = [(psf.grid_x_mm, width_mm / 2), (psf.grid_y_mm, height_mm / 2)]
    for places_mm, half_mm in axes:
        if places_mm.size < 2:
            continue
        farthest = float(np.abs(places_mm).max())
        step = float(np.diff(places_mm).max())
        if farthest - step > half_mm:
            return (
                f"kernels lie up to {farthest:.4g} mm from the axis, the sensor ends at "
                f"{half_mm:.4g} mm: are their places in mm?"
            )
        if farthest + step < half_mm:
            return (
                f"kernels are known to {farthest:.4g} mm from the axis, the sensor ends at "
                f"{half_mm:.4g} mm; the outermost ones hold beyond"
            )
    return None


def _place_options(options: ImportOptions) -> str:
    names = ("span_mm", "frame_mm", "x_mm", "y_mm", "heights_mm")
    return ", ".join(option_text(name) for name in names if getattr(options, name) is not None)


def _radial(heights: FloatGrid, count: int) -> tuple[Places | None, list[str]]:
    faults = []
    if heights.size != count:
        faults.append(f"{option_text('heights_mm')} has {heights.size} numbers for {count} kernels")
    if heights[0] != 0:
        faults.append(f"{option_text('heights_mm')} begins on the axis, at 0; got {heights[0]:g}")
    return (None, faults) if faults else (Places(symmetry="radial", heights_mm=heights), [])


def _grid(options: ImportOptions, rows: int, columns: int) -> tuple[Places | None, list[str]]:
    axes, faults = [], []
    for name, at, count in (("x_mm", 0, columns), ("y_mm", 1, rows)):
        values = getattr(options, name)
        if options.span_mm is not None:
            half = options.span_mm[at] / 2
            values = np.linspace(-half, half, count) if count > 1 else np.zeros(1)
        elif options.frame_mm is not None:
            side = options.frame_mm[at]
            values = (np.arange(count) + 0.5) * side / count - side / 2
        if values is None:
            faults.append(f"{option_text(name)} is missing: {count} numbers")
        elif len(values) != count:
            faults.append(f"{option_text(name)} has {len(values)} numbers for {count} kernels")
        elif count > 1 and not (np.diff(values) > 0).all():
            faults.append(f"{count} kernels side by side need a span > 0 in {name[0]}")
        axes.append(np.array([] if values is None else values, dtype=np.float64))
    if faults:
        return None, faults
    heights = grid_heights_mm(*axes)
    return Places(symmetry="grid", heights_mm=heights, x_mm=axes[0], y_mm=axes[1]), []

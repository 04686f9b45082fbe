"""A stack of kernels as files hold them, and what the caller says of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.psf import PsfUncertainty

FloatGrid = NDArray[np.float64]
Middle = Literal["middle", "peak", "centroid"]
Background = Literal["keep", "border"]

FLIPS: Final = ("", "x", "y", "xy", "kernels")
GREY: Final = "Y"
WAVELENGTH_OF: Final = dict(zip("BGR", WAVELENGTHS_UM, strict=True)) | {GREY: WAVELENGTHS_UM[1]}
"""Wavelengths that stand for the colours of a sensor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """The caller's options of an import; None for what files state, or the usual.

    Attributes:
        axes: Names of the axes of an array: row, col, i (both in one), c, h, w, and 1 for none.
        colours: Of axis c in its order, out of R, G, B; Y alone for one kernel for all.
        wavelengths_um: Of axis c in its order, in place of colours.
        variable: Name of the array in a file of several.
        grid: (rows, columns) of axis i, or of the kernels in one picture.
        pitch_um: Spacing of the samples.
        to_pitch_um: Pixel pitch of the sensor; None for that of the samples.
        span_mm: (width, height) from the middle of the first kernel to that of the last.
        frame_mm: (width, height) of the picture, every kernel in the middle of an equal part.
        x_mm: Position of every column, to the right of the axis.
        y_mm: Position of every row, down from the axis.
        heights_mm: Distance from the axis of every kernel of a lens of revolution.
        flip: Axes along which the file runs the other way, "x", "y" or "xy"; "kernels" turns every
            kernel by 180 degrees where it is.
        centre: Which sample is the middle of a kernel.
        background: Whether the level along the border of a kernel is taken off.
        side_px: Odd side of the kernels; None for as far as they reach.
        depth_m: Distance at which they were measured.
        uncertainty: How far they may be off; None for an estimate.
    """

    axes: str | None = None
    colours: str | None = None
    wavelengths_um: Sequence[float] | None = None
    variable: str | None = None
    grid: tuple[int, int] | None = None
    pitch_um: float | None = None
    to_pitch_um: float | None = None
    span_mm: tuple[float, float] | None = None
    frame_mm: tuple[float, float] | None = None
    x_mm: Sequence[float] | None = None
    y_mm: Sequence[float] | None = None
    heights_mm: Sequence[float] | None = None
    flip: str = ""
    centre: Middle = "middle"
    background: Background = "keep"
    side_px: int | None = None
    depth_m: float = np.inf
    uncertainty: PsfUncertainty | None = None

    def __post_init__(self) -> None:
        refuse([*self._number_faults(), *self._choice_faults()])

    def _number_faults(self) -> list[str]:
        faults = [
            f"{option_text(name)} must be > 0; got {value:g}"
            for name, value in (
                ("pitch_um", self.pitch_um),
                ("to_pitch_um", self.to_pitch_um),
                ("depth_m", self.depth_m),
            )
            if value is not None and not value > 0
        ]
        for name in ("x_mm", "y_mm", "heights_mm"):
            values = getattr(self, name)
            if values is not None and not (np.diff(values) > 0).all():
                faults.append(f"{option_text(name)} must increase; got {list(values)}")
        for name in ("span_mm", "frame_mm"):
            sides = getattr(self, name)
            if sides is not None and min(sides) < 0:
                faults.append(f"{option_text(name)} takes WIDTHxHEIGHT in mm; got {sides}")
        side = self.side_px
        if side is not None and (side < 3 or side % 2 == 0):
            faults.append(f"{option_text('side_px')} must be odd and >= 3; got {side}")
        return faults

    def _choice_faults(self) -> list[str]:
        faults = []
        places = ("span_mm", "frame_mm", "heights_mm")
        several = [option_text(name) for name in places if getattr(self, name) is not None]
        if self.x_mm is not None or self.y_mm is not None:
            several.append(f"{option_text('x_mm')} and {option_text('y_mm')}")
        if len(several) > 1:
            faults.append(f"places are stated once; use one of {', '.join(several)}")
        if self.colours is not None and self.wavelengths_um is not None:
            faults.append(
                f"axis c is of colours or of wavelengths; use one of {option_text('colours')} and "
                f"{option_text('wavelengths_um')}"
            )
        letters = (self.colours or GREY).upper()
        if not set(letters) <= set(WAVELENGTH_OF) or len(set(letters)) != len(letters):
            faults.append(
                f"{option_text('colours')} takes an order of R, G and B, like RGB, or {GREY} for "
                f"one kernel for all colours; got {self.colours}"
            )
        if self.flip not in FLIPS:
            faults.append(f"{option_text('flip')} takes {', '.join(FLIPS[1:])}; got {self.flip}")
        return faults


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KernelStack:
    """Kernels as their files hold them.

    Attributes:
        values: (row, column, colour, h, w) float64, the rows of everything downwards.
        pitch_um: Spacing of the samples; None if not stated.
        colours: Letters of the colours; None if not stated.
        wavelengths_um: Of the colours; None if not stated.
        heights_mm: Distances from the axis, of columns of a lens of revolution; None otherwise.
        middle_px: (row, column) of the middle; None if not stated.
        files: How many files were read.
        notes: What a person should know.
    """

    values: FloatGrid
    pitch_um: float | None = None
    colours: str | None = None
    wavelengths_um: tuple[float, ...] | None = None
    heights_mm: tuple[float, ...] | None = None
    middle_px: tuple[int, int] | None = None
    files: int = 1
    notes: tuple[str, ...] = ()


def refuse(faults: Sequence[str]) -> None:
    """Raise one error that names every fault, if there are any.

    Raises:
        ContractError: If so.
    """
    if faults:
        raise ContractError("; ".join(faults))

"""Kernels that others measured or computed to a PSF of camkit: `camkit psf import`."""

import re
from collections.abc import Sequence
from typing import Literal

from camkit.bundle.psf_file import psf_to_bytes
from camkit.calibrate.result_files import check_results, write_results
from camkit.calibration.psf_import.clean_kernels import ImportedPsf, imported_psf
from camkit.calibration.psf_import.kernel_stack import ImportOptions
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.field_types import checked
from camkit.psf import PsfUncertainty
from camkit.report.pages.calibration.psf_field_page import psf_field_html
from camkit.runtime.files.in_memory import FilePath

Sides = str | tuple[float, float]
Line = str | Sequence[float]


@checked
def import_psf(
    source: FilePath,
    out: FilePath | None = None,
    *,
    axes: str | None = None,
    colours: str | None = None,
    wavelengths_um: Line | None = None,
    variable: str | None = None,
    grid: str | tuple[int, int] | None = None,
    pitch_um: float | None = None,
    to_pitch_um: float | None = None,
    span_mm: Sides | None = None,
    frame_mm: Sides | None = None,
    x_mm: Line | None = None,
    y_mm: Line | None = None,
    heights_mm: Line | None = None,
    flip: str = "",
    centre: Literal["middle", "peak", "centroid"] = "middle",
    background: Literal["keep", "border"] = "keep",
    side_px: int | None = None,
    depth_m: float = float("inf"),
    uncertainty: str | Sequence[float] | None = None,
    page: FilePath | None = None,
    overwrite: bool = False,
) -> ImportedPsf:
    """Convert kernels of other programs to a PSF: arrays, pictures, listings of Zemax.

    Args:
        source: File, folder, or pattern such as "crops/psf_r{row}_c{col}.png".
        out: PSF to write (.safetensors); None writes none.
        axes: Axes of an array, such as "row,col,c,h,w"; None for the usual of its shape.
        colours: Colours of axis c in their order, such as "RGB"; "Y" for one kernel for all.
        wavelengths_um: Wavelengths of axis c in their order, in place of colours.
        variable: Name of the array in a file of several.
        grid: Rows and columns of axis i, or of one picture of all kernels.
        pitch_um: Spacing of the samples; None for what the files state.
        to_pitch_um: Pixel pitch of the sensor; None for that of the samples.
        span_mm: Width and height from the middle of the first kernel to that of the last.
        frame_mm: Width and height of the picture, each kernel in the middle of an equal part.
        x_mm: Position of every column, right of the axis.
        y_mm: Position of every row, down from the axis.
        heights_mm: Distance from the axis of every kernel of a lens of revolution.
        flip: Axes that run the other way in the files, "x", "y" or "xy"; "kernels" turns every
            kernel by 180 degrees where it is.
        centre: Sample that is the middle of a kernel.
        background: "border" subtracts the level along the border of every kernel.
        side_px: Odd side of the kernels; None for as far as they reach.
        depth_m: Distance at which they were measured.
        uncertainty: Noise, shift in pixels and width of `camkit.psf.PsfUncertainty`; None
            estimates them.
        page: Page to write (.html); None writes none.
        overwrite: Whether files that exist are replaced.

    Raises:
        ContractError: If options are missing or do not fit, in one message, or a file exists.
        DecodeError: If a file cannot be read.
    """
    outputs = check_results(out, ".safetensors", page, overwrite=overwrite)
    result = imported_psf(
        str(source),
        ImportOptions(
            axes=axes,
            colours=colours,
            wavelengths_um=_line("wavelengths_um", wavelengths_um),
            variable=variable,
            grid=_grid(grid),
            pitch_um=pitch_um,
            to_pitch_um=to_pitch_um,
            span_mm=_sides("span_mm", span_mm),
            frame_mm=_sides("frame_mm", frame_mm),
            x_mm=_line("x_mm", x_mm),
            y_mm=_line("y_mm", y_mm),
            heights_mm=_line("heights_mm", heights_mm),
            flip=flip.lower(),
            centre=centre,
            background=background,
            side_px=side_px,
            depth_m=depth_m,
            uncertainty=_uncertainty(uncertainty),
        ),
    )
    write_results(
        outputs,
        lambda: psf_to_bytes(result.psf, result.uncertainty),
        lambda: psf_field_html(result, str(source)),
    )
    return result


def _line(name: str, values: Line | None) -> tuple[float, ...] | None:
    """Return numbers, also of a text A,B,C."""
    if values is None:
        return None
    words = re.split(r"[,\s]+", values.strip()) if isinstance(values, str) else values
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        raise ContractError(f"{option_text(name)} takes numbers A,B,C; got {values!r}") from None


def _sides(name: str, sides: Sides | None) -> tuple[float, float] | None:
    """Return (width, height), also of a text WxH."""
    if sides is None:
        return None
    numbers = _line(name, sides.lower().replace("x", ",") if isinstance(sides, str) else sides)
    if numbers is None or len(numbers) != 2:
        raise ContractError(
            f"{option_text(name)} takes WIDTHxHEIGHT in mm, like 9.6x7.2; got {sides}"
        )
    return numbers[0], numbers[1]


def _grid(grid: str | tuple[int, int] | None) -> tuple[int, int] | None:
    if grid is None:
        return None
    match = re.fullmatch(r"(\d+)x(\d+)", grid.lower()) if isinstance(grid, str) else None
    rows, columns = (int(match[1]), int(match[2])) if match is not None else (0, 0)
    if not isinstance(grid, str):
        rows, columns = grid
    if min(rows, columns) < 1:
        raise ContractError(f"{option_text('grid')} takes ROWSxCOLUMNS, like 5x7; got {grid}")
    return rows, columns


def _uncertainty(values: str | Sequence[float] | None) -> PsfUncertainty | None:
    numbers = _line("uncertainty", values)
    if numbers is None:
        return None
    if len(numbers) != 3:
        raise ContractError(
            f"{option_text('uncertainty')} takes NOISE,SHIFT_PX,WIDTH, like 0.01,0.05,0.02; got "
            f"{values}"
        )
    return PsfUncertainty(noise=numbers[0], shift_px=numbers[1], width=numbers[2])

"""Arrays of kernels in any order of axes, brought to row, column, colour, h, w."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.psf_import.kernel_stack import FloatGrid, ImportOptions
from camkit.caller import option_text
from camkit.errors import ContractError

ORDER: Final = ("row", "col", "c", "h", "w")
RUNNING: Final = "i"
NONE: Final = "1"
COLOURS: Final = 3
_USUAL: Final = {2: "h,w", 4: "row,col,h,w", 5: "row,col,c,h,w"}


def ordered(array: NDArray[Any], options: ImportOptions, what: str) -> FloatGrid:
    """Return (row, column, colour, h, w) of an array.

    Args:
        array: Of numbers.
        options: Their axes, and the grid of a running number or of a sheet.
        what: Name of the array for messages.

    Raises:
        ContractError: If the axes do not fit the array.
    """
    if not (np.issubdtype(array.dtype, np.number) or array.dtype == bool):
        raise ContractError(f"{what} holds {array.dtype}, no numbers")
    if np.iscomplexobj(array):
        raise ContractError(f"{what} is complex: a PSF is the squared magnitude of an amplitude")
    names = _names(array, options, what)
    single = tuple(axis for axis, name in enumerate(names) if name == NONE)
    values = np.squeeze(array, axis=single).astype(np.float64)
    names = [name for name in names if name != NONE]
    if options.grid is not None:
        values, names = _unrolled(values, names, options.grid, what)
    values = values.reshape(values.shape + (1,) * (len(ORDER) - len(names)))
    names += [name for name in ORDER if name not in names]
    return np.ascontiguousarray(values.transpose([names.index(name) for name in ORDER]))


def _names(array: NDArray[Any], options: ImportOptions, what: str) -> list[str]:
    """Return the name of every axis, as the caller states it or as is usual."""
    text = options.axes
    if text is None:
        text = _usual(array.shape)
    if text is None:
        raise ContractError(
            f"{what} has the shape {array.shape}; name its axes by {option_text('axes')}, an order "
            f"of {','.join(ORDER)} ({RUNNING} for row and col in one, {NONE} for none), like "
            f"{option_text('axes', 'row,col,c,h,w')}"
        )
    names = [name.strip().lower() for name in text.split(",")]
    sides = [name for name in names if name != NONE]
    are_known = set(sides) <= {*ORDER, RUNNING} and {"h", "w"} <= set(sides)
    if (
        not are_known
        or len(set(sides)) != len(sides)
        or (RUNNING in sides and {"row", "col"} & {*sides})
    ):
        raise ContractError(
            f"{option_text('axes')} takes each of {', '.join(ORDER)} once, with h and w, {RUNNING} "
            f"in place of row and col, {NONE} for an axis of none; got {text}"
        )
    if len(names) != array.ndim:
        raise ContractError(
            f"{what} has {array.ndim} axes {array.shape}, {option_text('axes')} names {len(names)}"
        )
    extra = [at for at, name in enumerate(names) if name == NONE and array.shape[at] != 1]
    if extra:
        raise ContractError(f"axis {extra[0]} of {what} has {array.shape[extra[0]]} entries, not 1")
    if RUNNING in names and options.grid is None:
        count = array.shape[names.index(RUNNING)]
        raise ContractError(
            f"{what} numbers {count} kernels; state their rows and columns by "
            f"{option_text('grid')} ROWSxCOLUMNS"
        )
    return names


def _usual(shape: tuple[int, ...]) -> str | None:
    """Return the usual axes of a shape; None where there are several."""
    if len(shape) == 4 and COLOURS in shape:
        return None  # a grid of three rows or columns, or colours of numbered places
    if len(shape) == 3:
        first, last = shape[0] in (1, 3), shape[2] in (1, 3)
        return None if first == last else ("c,h,w" if first else "h,w,c")
    return _USUAL.get(len(shape))


def _unrolled(
    values: FloatGrid, names: list[str], grid: tuple[int, int], what: str
) -> tuple[FloatGrid, list[str]]:
    """Split a running number, or one sheet of kernels, into rows and columns."""
    rows, columns = grid
    if RUNNING in names:
        at = names.index(RUNNING)
        if values.shape[at] != rows * columns:
            raise ContractError(
                f"{option_text('grid')} {rows}x{columns} needs {rows * columns} kernels; {what} "
                f"has {values.shape[at]}"
            )
        shape = (*values.shape[:at], rows, columns, *values.shape[at + 1 :])
        return values.reshape(shape), [*names[:at], "row", "col", *names[at + 1 :]]
    if {"row", "col"} & {*names}:
        return values, names
    sheet = np.moveaxis(values, (names.index("h"), names.index("w")), (-2, -1))
    h, w = sheet.shape[-2:]
    if h % rows or w % columns:
        raise ContractError(
            f"{what} of {h} x {w} samples is no sheet of {rows} x {columns} equal kernels"
        )
    tiles = sheet.reshape(*sheet.shape[:-2], rows, h // rows, columns, w // columns)
    rest = [name for name in names if name not in ("h", "w")]
    return tiles, [*rest, "row", "h", "col", "w"]

"""The text of a Huygens or FFT PSF as Zemax lists it; a plain table of numbers is read too.

Listing of Huygens PSF Data                    FFT PSF the same, with its own numbers
0.5500 um at 0.0000, 7.0000 (deg).             or 0.4861 to 0.6563 um at 7.0000 mm.
Data spacing is 0.250 um.
Image grid size: 64 by 64
Center point is: row 33, column 33             or Center point is: 33, 33
Values are relative intensity.
<a line of numbers for each row, the first row on top>
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from camkit.calibration.psf_import.kernel_stack import FloatGrid
from camkit.errors import DecodeError

SUFFIXES: Final = (".txt", ".dat", ".csv")
_BOMS: Final = ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"), (b"\xef\xbb\xbf", "utf-8-sig"))
_NUMBER: Final = r"([-+]?[\d.]+(?:[eE][-+]?\d+)?)"
_SPACING: Final = re.compile(rf"Data spacing is\s+{_NUMBER}\s*([^\s.]*)", re.IGNORECASE)
_FIELD: Final = re.compile(
    rf"{_NUMBER}(?:\s+to\s+{_NUMBER})?\s*(\S+)\s+at\s+{_NUMBER}(?:\s*,\s*{_NUMBER})?\s*\(?(\w+)"
)
_MIDDLE: Final = re.compile(r"Center point is:\s*(?:row\s*)?(\d+)\s*,\s*(?:column\s*)?(\d+)", re.I)
_GRID: Final = re.compile(r"Image grid size:\s*(\d+)\s*by\s*(\d+)", re.IGNORECASE)
_NAMES: Final = ("File", "Title", "Date")
"""Lines of the header that people write."""
_UM: Final = {"mm": 1000.0, "nm": 1e-3, "m": 1e6}
"""Micrometres in a unit; every other spelling is of micrometres, whose letter has many codes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Listing:
    """The content of a listing; None for what it does not state.

    Attributes:
        values: (h, w), the first line on top.
        spacing_um: Of the samples.
        wavelength_um: The middle of those that it sums.
        field: (x, y) of the object or image point.
        field_unit: "deg" or a unit of length.
        middle_px: (row, column), counted from 0.
    """

    values: FloatGrid
    spacing_um: float | None = None
    wavelength_um: float | None = None
    field: tuple[float, float] | None = None
    field_unit: str = ""
    middle_px: tuple[int, int] | None = None


def read_listing(path: Path) -> Listing:
    """Read a listing in UTF-16, UTF-8 or Latin-1.

    Raises:
        DecodeError: If it holds no table of numbers, or another than it states.
    """
    lines = _text(path.read_bytes()).splitlines()
    first = next((line for line in lines if line.strip()), "")
    if "cross section" in first.lower():
        raise DecodeError(f"{path.name} lists a cross section; save the text of the whole PSF")
    at, values = _table(lines, path)
    header = "\n".join(line for line in lines[:at] if not line.strip().startswith(_NAMES))
    spacing, field, middle = (pattern.search(header) for pattern in (_SPACING, _FIELD, _MIDDLE))
    grid = _GRID.search(header)
    if grid is not None and (int(grid[2]), int(grid[1])) != values.shape:
        raise DecodeError(
            f"{path.name} states a grid of {grid[1]} by {grid[2]} and lists {values.shape[1]} by "
            f"{values.shape[0]}; is it cut off?"
        )
    return Listing(
        values=values,
        spacing_um=None if spacing is None else float(spacing[1]) * _UM.get(spacing[2], 1.0),
        wavelength_um=None if field is None else _wavelength_um(field),
        field=None if field is None else _place(field),
        field_unit="" if field is None else field[6].lower(),
        middle_px=None if middle is None else (int(middle[1]) - 1, int(middle[2]) - 1),
    )


def _text(data: bytes) -> str:
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return data.decode(encoding, errors="replace")
    if data[1:2] == b"\0":
        return data.decode("utf-16-le", errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _table(lines: list[str], path: Path) -> tuple[int, FloatGrid]:
    """Return the first line of the last table of numbers, and the table."""
    rows: list[list[float]] = []
    first = 0
    for number, line in enumerate(lines):
        row = _row(line)
        if row is None or (rows and len(row) != len(rows[0])):
            rows = []
        if row:
            first = first if rows else number
            rows.append(row)
    if len(rows) < 2 or len(rows[0]) < 2:
        raise DecodeError(
            f"{path.name} ends with no table of numbers; save the text of a PSF, with decimal "
            "points and no commas in numbers"
        )
    return first, np.array(rows)


def _row(line: str) -> list[float] | None:
    """Return the numbers of a line, none of an empty one; None if it holds anything else."""
    try:
        return [float(word) for word in re.split(r"[\s;,]+", line.strip()) if word]
    except ValueError:
        return None


def _wavelength_um(field: re.Match[str]) -> float:
    ends = [float(field[1]), float(field[2] or field[1])]
    return float(np.mean(ends)) * _UM.get(field[3].rstrip("."), 1.0)


def _place(field: re.Match[str]) -> tuple[float, float]:
    first, second = float(field[4]), field[5]
    return (0.0, first) if second is None else (first, float(second))

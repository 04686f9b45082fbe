"""Corners of a board that were found before, in a JSON file.

    {"board": "9x6", "width_px": 6000, "height_px": 4000,
     "pictures": [[[x, y], ... one for each corner, row by row], ... one for each picture]}

Pixel centres are at integers. `square_mm` and `focal_px`, the nominal focal length, may be stated.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, ValidationError

from camkit.bundle.entry import Entry, Positive
from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import FloatGrid
from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_bytes

SUFFIX: Final = ".json"
MOST_BYTES: Final = 64 * 2**20
MOST_PICTURES: Final = 256
_Place = Annotated[float, Field(allow_inf_nan=False)]
_Side = Annotated[int, Field(ge=2, le=100_000)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CornerFile:
    """Corners of a board in pictures of one camera.

    Attributes:
        board: What was photographed.
        size: Width and height of the pictures, px.
        corners: (picture, corner, 2) x, y, row by row of the board.
        focal_px: Nominal focal length; None where none is stated.
    """

    board: Board
    size: tuple[int, int]
    corners: FloatGrid
    focal_px: float | None = None


class _Document(Entry, extra="ignore"):
    board: str
    width_px: _Side
    height_px: _Side
    unit: str = "px"
    square_mm: Positive | None = None
    focal_px: Positive | None = None
    pictures: Annotated[
        list[list[tuple[_Place, _Place]]], Field(min_length=1, max_length=MOST_PICTURES)
    ]


def read_corners(path: Path) -> CornerFile:
    """Read a corner file.

    Raises:
        DecodeError: If it cannot be read, or is no such file.
    """
    try:
        document = json.loads(read_side_bytes(path, "the corner file", most_bytes=MOST_BYTES))
    except ContractError as error:
        raise DecodeError(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise DecodeError(f"{path} is no JSON: {error}") from error
    try:
        return _corner_file(_Document.model_validate(document))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "the file"
        raise DecodeError(f"{path}: {place}: {first['msg']}") from error
    except (ContractError, DecodeError) as error:
        raise DecodeError(f"{path}: {error}") from error


def _corner_file(document: _Document) -> CornerFile:
    board = Board.read(document.board, document.square_mm)
    if document.unit != "px":
        raise DecodeError(f"corners are in px; got the unit {document.unit!r}")
    expected = board.columns * board.rows
    for number, picture in enumerate(document.pictures, start=1):
        if len(picture) != expected:
            raise DecodeError(
                f"a board of {board} has {expected} corners; picture {number} has {len(picture)}"
            )
    corners = np.array(document.pictures, dtype=np.float64)
    size = document.width_px, document.height_px
    _check_places(corners, size)
    return CornerFile(board=board, size=size, corners=corners, focal_px=document.focal_px)


def _check_places(corners: FloatGrid, size: tuple[int, int]) -> None:
    """Refuse corners outside of the picture, and pictures given twice."""
    outside = ((corners < -0.5) | (corners > np.array(size) - 0.5)).any(axis=(1, 2))
    if outside.any():
        raise DecodeError(
            f"picture {int(outside.argmax()) + 1} has corners outside of {size[0]}x{size[1]} px"
        )
    numbers: dict[Any, int] = {}
    for number, picture in enumerate(corners, start=1):
        first = numbers.setdefault(picture.tobytes(), number)
        if first != number:
            raise DecodeError(
                f"pictures {first} and {number} are the same picture; give every picture once"
            )


def is_corner_file(files: Sequence[Path]) -> bool:
    """Return whether what was given is a corner file in place of photographs.

    Raises:
        ContractError: If it is one among other files.
    """
    corner_files = [path for path in files if path.suffix.lower() == SUFFIX]
    if corner_files and len(files) > 1:
        raise ContractError(f"{corner_files[0]} holds corners: give it alone, or photographs")
    return bool(corner_files)

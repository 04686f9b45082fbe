"""A checkerboard: its inner corners, named as people count them."""

import re
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError

LEAST_CORNERS: Final = 3
MOST_CORNERS: Final = 100
_TEXT: Final = re.compile(r"\s*([0-9]{1,4})\s*[xX×]\s*([0-9]{1,4})\s*", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A board of squares.

    Attributes:
        columns: Inner corners along a row: squares less one.
        rows: Inner corners along a column.
        square_mm: Side of a square; None where nobody measured it.
    """

    columns: int
    rows: int
    square_mm: float | None = None

    def __post_init__(self) -> None:
        if not LEAST_CORNERS <= min(self.columns, self.rows) <= self.most <= MOST_CORNERS:
            raise ContractError(
                f"a board has {LEAST_CORNERS} to {MOST_CORNERS} inner corners along either side; "
                f"got {self}"
            )
        square = self.square_mm
        if square is not None and not 0 < square < float("inf"):
            raise ContractError(f"the squares of a board must be > 0 mm; got {square:g}")

    @classmethod
    def read(cls, text: str | tuple[int, int], square_mm: float | None = None) -> Self:
        """Read a board like 9x6, or (9, 6).

        Raises:
            ContractError: If the text is anything else.
        """
        match = _TEXT.fullmatch(text if isinstance(text, str) else "x".join(map(str, text)))
        if match is None:
            raise ContractError(
                f"a board is COLUMNSxROWS of its inner corners, like 9x6; got {text!r}"
            )
        return cls(columns=int(match[1]), rows=int(match[2]), square_mm=square_mm)

    def __str__(self) -> str:
        return f"{self.columns}x{self.rows}"

    @property
    def most(self) -> int:
        """Return the corners along the longer side."""
        return max(self.columns, self.rows)

    @property
    def points(self) -> NDArray[np.float64]:
        """Return (corner, 3) x, y, 0 of the corners, row by row, in squares."""
        y, x = np.mgrid[: self.rows, : self.columns]
        return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float64)

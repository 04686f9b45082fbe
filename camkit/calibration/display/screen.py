"""The layout of a screen, in its pixels: the blocks of the marks, the picture, the board."""

import re
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.display.marks import BLOCK_CELLS, WORD_CELLS
from camkit.calibration.geometry.board import Board
from camkit.errors import ContractError

FloatGrid = NDArray[np.float64]
Place = tuple[int, int, int, int]
"""X and y of the first pixel, width and height."""

LEAST_PX: Final = 320
MOST_PX: Final = 16384
CELLS_ALONG: Final = 54
"""Of a mark's block along the shorter side of the screen: a block takes a sixth of it."""
MOST_LONG: Final = 4
_TEXT: Final = re.compile(r"\s*([0-9]{1,6})\s*[xX×]\s*([0-9]{1,6})\s*", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """A display.

    Attributes:
        width_px: Columns.
        height_px: Rows.
    """

    width_px: int
    height_px: int

    def __post_init__(self) -> None:
        short, long = sorted((self.width_px, self.height_px))
        if not (short >= LEAST_PX and long <= min(MOST_PX, MOST_LONG * short)):
            raise ContractError(
                f"a screen has {LEAST_PX} to {MOST_PX} px along either side, and is at most "
                f"{MOST_LONG} times as long as wide; got {self}"
            )

    @classmethod
    def read(cls, text: str | tuple[int, int]) -> Self:
        """Read a screen like 1920x1080, or (1920, 1080).

        Raises:
            ContractError: If the text is anything else.
        """
        match = _TEXT.fullmatch(text if isinstance(text, str) else "x".join(map(str, text)))
        if match is None:
            raise ContractError(f"a screen is WIDTHxHEIGHT in px, like 1920x1080; got {text!r}")
        return cls(width_px=int(match[1]), height_px=int(match[2]))

    def __str__(self) -> str:
        return f"{self.width_px}x{self.height_px}"

    @property
    def cell_px(self) -> int:
        """Return the side of a cell of the marks."""
        return min(self.width_px, self.height_px) // CELLS_ALONG

    @property
    def blocks(self) -> tuple[tuple[int, int], ...]:
        """Return x, y of the first pixel of each block: top left, then clockwise."""
        side = BLOCK_CELLS * self.cell_px
        right, bottom = self.width_px - side, self.height_px - side
        return (0, 0), (right, 0), (right, bottom), (0, bottom)

    @property
    def corners(self) -> FloatGrid:
        """Return (block, 4, 2) x, y of the corners of the words' black rims."""
        cell = self.cell_px
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * WORD_CELLS * cell + cell - 0.5
        return np.stack([square + np.array(block) for block in self.blocks])

    def place(self, aspect: float) -> Place:
        """Return the place of a picture: as large as marks leave room, in the middle.

        Args:
            aspect: Width over height.
        """
        gap = self.cell_px
        margin = (BLOCK_CELLS + 1) * self.cell_px
        rooms = [
            (self.width_px - 2 * margin, self.height_px - 2 * gap),
            (self.width_px - 2 * gap, self.height_px - 2 * margin),
        ]
        sizes = [(min(w, h * aspect), min(h, w / aspect)) for w, h in rooms]
        width, height = (max(1, int(side)) for side in max(sizes, key=lambda size: size[0]))
        return (self.width_px - width) // 2, (self.height_px - height) // 2, width, height

    def squares(self, board: Board) -> tuple[int, Place]:
        """Return side of a square of a board, and where the board goes, a square of white about.

        Raises:
            ContractError: If squares would be of less than 4 px.
        """
        columns, rows = board.columns + 1, board.rows + 1
        side = min(self.width_px // (columns + 2), self.height_px // (rows + 2))
        if side < 4:
            raise ContractError(
                f"a board of {board} has squares of {side} px on a screen of {self}"
            )
        width, height = columns * side, rows * side
        place = ((self.width_px - width) // 2, (self.height_px - height) // 2, width, height)
        return side, place

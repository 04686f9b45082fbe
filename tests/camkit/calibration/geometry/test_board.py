"""Boards as people say them."""

import pytest

from camkit.calibration.geometry.board import Board
from camkit.errors import ContractError


@pytest.mark.parametrize("text", ["9x6", " 9 x 6 ", "9X6", "9×6"])
def test_columns_come_first(text: str) -> None:
    assert Board.read(text) == Board(columns=9, rows=6)
    assert str(Board.read(text)) == "9x6"


def test_corners_go_row_by_row_in_squares() -> None:
    points = Board(columns=4, rows=3).points
    assert points.shape == (12, 3)
    assert points[[0, 1, 4, 11]].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [3, 2, 0]]


@pytest.mark.parametrize("text", ["", "9", "9x", "x6", "9x6x2", "-9x6", "9.5x6", "ninexsix", "٩x6", "9x6\x00"])  # noqa: E501 # fmt: skip
def test_any_other_text_is_refused(text: str) -> None:
    with pytest.raises(ContractError, match="like 9x6"):
        Board.read(text)


@pytest.mark.parametrize("text", ["2x6", "9x0", "101x6", "9999x9999"])
def test_a_board_too_small_or_large_is_refused(text: str) -> None:
    with pytest.raises(ContractError, match="3 to 100 inner corners"):
        Board.read(text)


@pytest.mark.parametrize("square", [0.0, -1.0, float("inf"), float("nan")])
def test_squares_have_a_size(square: float) -> None:
    with pytest.raises(ContractError, match="must be > 0 mm"):
        Board.read("9x6", square)

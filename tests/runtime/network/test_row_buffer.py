"""The row buffer gives the rows of the padded picture and reads each row once."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.network.row_buffer import RowBuffer
from camkit.runtime.rows import ArrayRows


class _Counting(ArrayRows):
    def __init__(self, planes: FloatArray) -> None:
        super().__init__(planes)
        self.read_rows: list[int] = []

    def read(self, top: int, bottom: int) -> FloatArray:
        self.read_rows += range(top, bottom)
        return super().read(top, bottom)


def test_buffer_holds_the_padded_rows_and_reads_each_once() -> None:
    planes = np.random.default_rng(0).random((2, 150, 30)).astype(np.float32)
    source = _Counting(planes)
    padded = np.pad(planes, ((0, 0), (0, 10), (0, 2)), mode="edge")
    buffer = RowBuffer(source, 70, (160, 32))
    for top in (0, 20, 60, 90):
        np.testing.assert_array_equal(buffer.move_to(top), padded[:, top : top + 70])
    assert source.read_rows == list(range(150))


def test_sizes_that_contradict_are_refused() -> None:
    with pytest.raises(ContractError, match="do not hold"):
        RowBuffer(ArrayRows(np.zeros((1, 10, 10), np.float32)), 20, (16, 16))

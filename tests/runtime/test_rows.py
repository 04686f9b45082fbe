"""Rows that are pulled: what is read equals the picture, and nothing is kept for longer."""

import gc
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.rows import STALE_ROWS, ArrayRows, MappedRows, RollingRows


def _picture(height: int) -> FloatArray:
    return np.arange(2 * height * 3, dtype=np.float32).reshape(2, height, 3)


def _bands(picture: FloatArray, sizes: list[int]) -> Iterator[FloatArray]:
    top = 0
    for size in sizes:
        yield picture[:, top : top + size]
        top += size


@given(
    sizes=st.lists(st.integers(1, 7), min_size=1, max_size=8),
    steps=st.lists(st.integers(1, 9), min_size=1, max_size=12),
)
def test_rolling_rows_give_the_rows_of_the_picture(sizes: list[int], steps: list[int]) -> None:
    picture = _picture(sum(sizes))
    rolling = RollingRows((2, sum(sizes), 3), _bands(picture, sizes))
    ahead, behind = rolling.reader(), rolling.reader()
    top = 0
    for step in steps:
        bottom = min(top + step, sum(sizes))
        if top >= bottom:
            break
        np.testing.assert_array_equal(ahead.read(top, bottom), picture[:, top:bottom])
        np.testing.assert_array_equal(behind.read(top // 2, bottom), picture[:, top // 2 : bottom])
        top = bottom


def test_rows_behind_every_reader_are_forgotten() -> None:
    picture = _picture(20)
    rolling = RollingRows((2, 20, 3), _bands(picture, [2] * 10))
    reader = rolling.reader()
    for top in range(0, 20, 2):
        reader.read(top, top + 2)
        assert len(rolling._kept) <= 2


def test_reading_upwards_is_refused() -> None:
    rolling = RollingRows((2, 8, 3), _bands(_picture(8), [8]))
    reader = rolling.reader()
    reader.read(4, 6)
    with pytest.raises(ContractError, match="downwards"):
        reader.read(2, 6)


def test_bands_that_end_early_are_named() -> None:
    rolling = RollingRows((2, 8, 3), _bands(_picture(4), [4]))
    with pytest.raises(ContractError, match="bands end at 4"):
        rolling.reader().read(0, 6)


@pytest.mark.parametrize(("top", "bottom"), [(-1, 2), (3, 3), (2, 9)])
def test_rows_outside_the_picture_are_refused(top: int, bottom: int) -> None:
    rolling = RollingRows((2, 8, 3), _bands(_picture(8), [8]))
    with pytest.raises(ContractError, match="outside"):
        rolling.reader().read(top, bottom)


def test_mapped_rows_get_the_rows_and_the_first_of_them() -> None:
    picture = _picture(6)
    tops: list[int] = []

    def keep_top(rows: FloatArray, top: int) -> FloatArray:
        tops.append(top)
        return rows[:1] + rows[1:2]

    mapped = MappedRows(ArrayRows(picture), keep_top, 1)
    np.testing.assert_array_equal(mapped.read(1, 4), picture[:1, 1:4] + picture[1:2, 1:4])
    assert (mapped.shape, tops) == ((1, 6, 3), [1])


def test_array_rows_need_channels() -> None:
    with pytest.raises(ContractError, match=r"channel, h, w"):
        ArrayRows(np.zeros((4, 4), dtype=np.float32))


def test_rows_are_freed_with_their_last_reader() -> None:
    closed: list[bool] = []

    def bands() -> Iterator[FloatArray]:
        try:
            yield _picture(4)
            yield _picture(4)
        finally:
            closed.append(True)

    reader = RollingRows((2, 8, 3), bands()).reader()
    reader.read(0, 2)
    gc.disable()
    try:
        del reader
        assert closed == [True]
    finally:
        gc.enable()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_mapped_rows_do_not_depend_on_threads(threads: int) -> None:
    picture = np.random.default_rng(0).random((2, 90, 40000), dtype=np.float32)

    def shade(rows: FloatArray, top: int) -> FloatArray:
        return rows * np.arange(top, top + rows.shape[1], dtype=np.float32)[:, None]

    mapped = MappedRows(ArrayRows(picture), shade, 2, threads=threads)
    np.testing.assert_array_equal(mapped.read(10, 77), shade(picture[:, 10:77], 10))


def test_of_a_tall_band_only_the_rows_still_needed_are_kept() -> None:
    tall = 4 * STALE_ROWS
    picture = _picture(tall + 1)
    rolling = RollingRows(picture.shape, _bands(picture, [tall, 1]))
    reader = rolling.reader()
    reader.read(0, 1)
    top = tall - 2
    np.testing.assert_array_equal(reader.read(top, tall + 1), picture[:, top : tall + 1])
    kept = [band for _, band in rolling._kept]
    assert [band.shape[1] for band in kept] == [2, 1]
    assert kept[0].base is None

"""Rows that are pulled: what is read equals the picture, and nothing is kept for longer."""

import gc
import weakref
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.rows import STALE_ROWS, ArrayRows, RollingRows, changed_bands


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
        assert len(rolling._bands_read) <= 2


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


def test_bands_are_changed_in_place_and_told_their_first_row() -> None:
    picture = _picture(6)
    tops: list[int] = []

    def change(rows: FloatArray, top: int) -> None:
        tops.append(top)
        rows += np.float32(top)

    bands = [band.copy() for band in _bands(picture, [2, 4])]
    changed = list(changed_bands(iter(bands), change))
    assert tops == [0, 2]
    for band, same, top in zip(changed, bands, (0, 2), strict=True):
        assert band is same
        np.testing.assert_array_equal(band, picture[:, top : top + band.shape[1]] + top)


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
def test_changed_bands_do_not_depend_on_threads(threads: int) -> None:
    picture = np.random.default_rng(0).random((2, 90, 40000), dtype=np.float32)
    expected = picture * np.arange(90, dtype=np.float32)[:, None]

    def shade(rows: FloatArray, top: int) -> None:
        rows *= np.arange(top, top + rows.shape[1], dtype=np.float32)[:, None]

    bands = changed_bands(_bands(picture, [67, 23]), shade, threads=threads)
    np.testing.assert_array_equal(np.concatenate(list(bands), axis=1), expected)


def test_of_a_tall_band_only_the_rows_still_needed_are_kept() -> None:
    tall = 4 * STALE_ROWS
    picture = _picture(tall + 1)
    rolling = RollingRows(picture.shape, _bands(picture, [tall, 1]))
    reader = rolling.reader()
    reader.read(0, 1)
    top = tall - 2
    np.testing.assert_array_equal(reader.read(top, tall + 1), picture[:, top : tall + 1])
    kept = [band for _, band in rolling._bands_read]
    assert [band.shape[1] for band in kept] == [2, 1]
    assert kept[0].base is None


def test_no_band_is_held_while_the_next_one_is_made() -> None:
    held: list[weakref.ref[FloatArray]] = []

    def bands() -> Iterator[FloatArray]:
        for _ in range(2):
            assert all(band() is None for band in held)
            band = np.ones((3, 16, 16), np.float32)
            held.append(weakref.ref(band))
            yield band
            del band

    for band in changed_bands(bands(), lambda *_: None):
        assert band.shape == (3, 16, 16)
        del band
    assert len(held) == 2


def test_for_a_reader_that_is_gone_nothing_is_kept() -> None:
    picture = _picture(20)
    rolling = RollingRows((2, 20, 3), _bands(picture, [2] * 10))
    reader, slow = rolling.reader(), rolling.reader()
    reader.read(0, 12)
    reader.read(10, 12)
    assert len(rolling._bands_read) == 6, "the slow one may still want them"
    del slow
    np.testing.assert_array_equal(reader.read(10, 14), picture[:, 10:14])
    assert len(rolling._bands_read) <= 2


def test_a_reader_that_is_gone_holds_up_nobody_who_reads_on() -> None:
    picture = _picture(20)
    rolling = RollingRows((2, 20, 3), _bands(picture, [2] * 10))
    first, second = rolling.reader(), rolling.reader()
    first.read(0, 20)
    del first
    for top in range(0, 20, 4):
        np.testing.assert_array_equal(second.read(top, top + 4), picture[:, top : top + 4])

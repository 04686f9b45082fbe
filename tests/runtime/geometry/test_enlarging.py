"""Enlarged pictures are those of the whole, in bands, and leave no range."""

import cv2
import numpy as np

from camkit.runtime.geometry.enlarging import enlarged_bands
from camkit.runtime.rows import ArrayRows


def _enlarged(planes: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    return np.concatenate(list(enlarged_bands(ArrayRows(planes), 2, size_px)), axis=1)


def test_bands_equal_the_whole_picture() -> None:
    planes = np.random.default_rng(0).random((3, 300, 40)).astype(np.float32)
    whole = [cv2.resize(p, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR) for p in planes]
    np.testing.assert_array_equal(_enlarged(planes, (600, 80)), np.stack(whole))


def test_nothing_leaves_the_range_and_the_mean_stays() -> None:
    planes = np.zeros((1, 20, 20), np.float32)
    planes[0, 10, 10] = 50
    large = _enlarged(planes, (40, 40))
    assert large.min() >= 0
    assert large.max() <= 50
    assert large.mean() * 4 == planes.mean() * 4


def test_rows_and_columns_that_filled_no_square_repeat_the_edge() -> None:
    large = _enlarged(np.full((3, 5, 6), 0.25, np.float32), (11, 13))
    assert large.shape == (3, 11, 13)
    assert (large == 0.25).all()

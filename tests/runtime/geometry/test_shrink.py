"""Planes become smaller by the means of squares; what is no whole square is left out."""

import numpy as np

from camkit.runtime.geometry.shrink import shrunk


def test_squares_become_their_means() -> None:
    planes = np.arange(24, dtype=np.float32).reshape(1, 4, 6)
    assert shrunk(planes, 2).tolist() == [[[3.5, 5.5, 7.5], [15.5, 17.5, 19.5]]]
    assert shrunk(planes, 1) is planes


def test_what_is_left_over_is_left_out() -> None:
    planes = np.ones((2, 5, 7), np.float32)
    planes[:, 4:] = planes[:, :, 6:] = 100
    made = shrunk(planes, 2)
    assert made.shape == (2, 2, 3)
    assert made.dtype == np.float32
    assert (made == 1).all()

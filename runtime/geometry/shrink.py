"""Planes made smaller by whole numbers: the means of squares of pixels."""

import numpy as np

from camkit.arrays import FloatArray


def shrunk(planes: FloatArray, times: int) -> FloatArray:
    """Return the means over squares of `times` pixels a side.

    Args:
        planes: (c, h, w).
        times: Side of a square; 1 gives the planes as they are.

    Returns:
        (c, h // times, w // times) float32; what is left over at the right and below is left out.
    """
    if times == 1:
        return planes
    channels, height, width = planes.shape
    rows, columns = height // times, width // times
    inside = planes[:, : rows * times, : columns * times]
    squares = inside.reshape(channels, rows, times, columns, times)
    return np.asarray(squares.mean(axis=(2, 4)), dtype=np.float32)

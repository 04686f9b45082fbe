"""Pixels lie on the lines between the middles of cells."""

import numpy as np
import pytest

from camkit.streaks.cell_rows import rows_of_cells


@pytest.mark.parametrize("pitch", [2, 4])
@pytest.mark.parametrize("offset", [(0.0, 0.5), (1.5, 1.0), (2.5, 0.0)])
def test_rows_lie_on_the_lines_between_the_middles_of_cells(
    pitch: int, offset: tuple[float, float]
) -> None:
    """Beyond the outermost middles the light is even."""
    field = np.random.default_rng(0).uniform(0, 9, (6, 7)).astype(np.float32)
    top, rows, width = 3, 4 * pitch, 7 * pitch + 3
    at_y = (np.arange(top, top + rows) - offset[0]) / pitch
    at_x = (np.arange(width) - offset[1]) / pitch
    lines = np.stack([np.interp(at_y, np.arange(6), column) for column in field.T], axis=1)
    wanted = np.stack([np.interp(at_x, np.arange(7), line) for line in lines])
    got = rows_of_cells(field, pitch, offset, top, rows, width)
    assert got.shape == (rows, width)
    np.testing.assert_allclose(got, wanted, atol=1e-5)

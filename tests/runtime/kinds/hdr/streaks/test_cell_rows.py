"""Pixels lie on the lines between the middles of cells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.runtime.kinds.hdr.streaks.cell_rows import Lattice, rows_of_cells


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


@pytest.mark.parametrize("pitch", [2, 4])
@pytest.mark.parametrize(("y", "x"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_pixels_of_a_lattice_have_the_bits_of_every_pixel(pitch: int, y: int, x: int) -> None:
    field = np.random.default_rng(1).uniform(0, 9, (6, 7)).astype(np.float32)
    offset, height, width = (1.5, 1.0), 20, 27
    wanted = rows_of_cells(field, pitch, offset, 8, height, width)[y::2, x::2]
    lattice = Lattice(top=8 + y, left=x, step_px=2)
    np.testing.assert_array_equal(lattice.cells(field, pitch, offset, wanted.shape), wanted)
    at = lattice.pixels_in((11, 5, 19, 22), wanted.shape)
    part = lattice.part(at).cells(field, pitch, offset, wanted[at].shape)
    np.testing.assert_array_equal(part, wanted[at])


@given(
    box=st.tuples(*[st.integers(-9, 40)] * 4),
    first=st.tuples(st.integers(0, 9), st.integers(0, 9)),
    shape=st.tuples(st.integers(1, 9), st.integers(1, 9)),
    step=st.sampled_from([1, 2]),
)
def test_a_lattice_knows_which_of_its_pixels_lie_in_a_box(
    box: tuple[int, int, int, int], first: tuple[int, int], shape: tuple[int, int], step: int
) -> None:
    rows, columns = Lattice(top=first[0], left=first[1], step_px=step).pixels_in(box, shape)
    for pixels, start, count, low, high in (
        (rows, first[0], shape[0], box[0], box[2]),
        (columns, first[1], shape[1], box[1], box[3]),
    ):
        wanted = [n for n in range(count) if low <= start + step * n < high]
        assert list(range(count))[pixels] == wanted

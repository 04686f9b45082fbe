"""A mosaic as planes of half its size, and back, at every phase and size."""

import numpy as np
import pytest

from camkit.bundle.stages.foreign.pack import PLACES, CodedColour
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.runtime.rows import ArrayRows
from camkit.runtime.stages.pack import PackedRows, cell_start, mirrored
from camkit.runtime.stages.unpack import CutRows, WovenRows

ORDER: tuple[CodedColour, ...] = ("R", "G1", "B", "G2")


def _mosaic(size_px: tuple[int, int]) -> np.ndarray:
    rng = np.random.default_rng(size_px[0])
    return rng.random((1, *size_px), dtype=np.float32)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("size_px", [(6, 8), (7, 9), (2, 3)])
def test_every_sample_lies_in_the_plane_of_its_colour(
    cfa: CfaPattern, size_px: tuple[int, int]
) -> None:
    mosaic = _mosaic(size_px)
    packed = PackedRows(ArrayRows(mosaic), cfa, ORDER)
    planes = packed.read(0, packed.shape[1])
    down, right = cell_start(cfa)
    for y in range(size_px[0]):
        for x in range(size_px[1]):
            row, column = y + down, x + right
            colour = "RGB"[cfa_channels(cfa)[y % 2][x % 2]]
            place = next(c for c, at in PLACES.items() if at == (row % 2, column % 2))
            assert place[0] == colour
            plane = planes[ORDER.index(place)]
            assert plane[row // 2, column // 2] == mosaic[0, y, x]


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("size_px", [(6, 8), (7, 9), (8, 5), (2, 2)])
def test_unpacked_cells_are_the_mosaic_again(cfa: CfaPattern, size_px: tuple[int, int]) -> None:
    mosaic = _mosaic(size_px)
    packed = PackedRows(ArrayRows(mosaic), cfa, ORDER)
    woven = WovenRows(ArrayRows(packed.read(0, packed.shape[1])), ORDER)
    cut = CutRows(woven, cell_start(cfa), size_px)
    np.testing.assert_array_equal(cut.read(0, size_px[0]), mosaic)
    parts = [cut.read(y, y + 1) for y in range(size_px[0])]
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), mosaic)


def test_rows_of_cells_have_the_bits_of_the_whole() -> None:
    packed = PackedRows(ArrayRows(_mosaic((10, 6))), "GBRG", ORDER)
    whole = packed.read(0, 6)
    np.testing.assert_array_equal(
        np.concatenate([packed.read(y, y + 1) for y in range(6)], axis=1), whole
    )


def test_what_lies_beyond_the_border_is_mirrored_about_its_sample() -> None:
    assert mirrored(np.arange(-2, 7), 5).tolist() == [2, 1, 0, 1, 2, 3, 4, 3, 2]

"""Streaks of small windows are those of their pixels, streaks of large ones those of cells."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks import streak_rows
from camkit.runtime.kinds.hdr.streaks.cell_rows import Lattice
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, recover
from camkit.runtime.kinds.hdr.streaks.regions import Window
from camkit.runtime.kinds.hdr.streaks.spots import lit_pixels
from camkit.runtime.kinds.hdr.streaks.streak_rows import (
    BRIGHTEST,
    FAINT,
    CellStreaks,
    PixelStreaks,
    Streaks,
    _half,
    streaks_of,
)
from tests.streak_factory import (
    blurred,
    captured_cells,
    one_light,
    star,
    star_kernels,
    street,
    with_lamps,
)

SIZE = (161, 209)
LAMPS = [(60, 70, 2.0, (200.0, 150.0, 90.0)), (120, 160, 3.0, (60.0, 60.0, 60.0))]


@pytest.fixture(scope="module")
def found() -> Recovery:
    scene = with_lamps(street(*SIZE), LAMPS)
    light = blurred(scene, star())
    return recover(captured_cells(light, None), star_kernels(None))


def _under(streaks: list[Streaks], size: tuple[int, int] = SIZE, rows: int = 1000) -> FloatArray:
    """Give the streaks of a whole picture, band by band."""
    planes = np.zeros((COLOURS, *size), np.float32)
    for top in range(0, size[0], rows):
        for colour, plane in enumerate(planes):
            for one in streaks:
                one.add(plane[top : top + rows], colour, Lattice(top=top))
    return planes


def test_streaks_of_pixels_are_those_of_a_slow_sum(found: Recovery) -> None:
    """Beyond an odd border there are no cells, but streaks all the same."""
    lit = lit_pixels(found)
    got = _under(streaks_of(found, lit))
    for colour, kernel in enumerate(found.kernels):
        assert kernel is not None  # full planes
        light = np.zeros(SIZE)
        light[lit.rows, lit.columns] = lit.light[colour]
        half = kernel.shape[0] // 2
        whole = scipy.signal.fftconvolve(light, kernel.astype(np.float64))
        wanted = whole[half : half + SIZE[0], half : half + SIZE[1]]
        np.testing.assert_allclose(got[colour], wanted, rtol=2e-3, atol=1e-4)
        assert wanted.max() > 0.05


@pytest.mark.parametrize("rows", [1, 7, 64])
def test_bands_of_any_height_have_the_same_bits(found: Recovery, rows: int) -> None:
    streaks = streaks_of(found, lit_pixels(found))
    np.testing.assert_array_equal(_under(streaks, rows=rows), _under(streaks))


def test_of_a_mosaic_green_alone_has_samples_enough(found: Recovery) -> None:
    scene = with_lamps(street(*SIZE), LAMPS)
    mosaic = recover(captured_cells(blurred(scene, star())), star_kernels())
    assert [kernel is None for kernel in mosaic.kernels] == [True, False, True]
    lit = lit_pixels(mosaic)
    streaks = streaks_of(mosaic, lit)
    assert [type(one) for one in streaks] == [PixelStreaks, CellStreaks]
    got, cells = _under(streaks), _under([CellStreaks(mosaic.regions[0], mosaic.fine.offset_px)])
    np.testing.assert_array_equal(got[[0, 2]], cells[[0, 2]])
    assert (got[1] != cells[1]).any()


def test_streaks_too_faint_to_show_keep_their_cells(found: Recovery) -> None:
    """Where nobody would see the difference no pixel is computed."""
    (region,) = found.regions
    brightest = region.streaks[region.light == 0].max()
    kinds = []
    for factor in (1.01, 0.99):
        dim = replace(region, streaks=region.streaks * np.float32(factor * FAINT / brightest))
        (one,) = streaks_of(replace(found, regions=(dim,)), lit_pixels(found))
        kinds.append(type(one))
    assert kinds == [PixelStreaks, CellStreaks]


def test_large_windows_keep_their_cells_and_both_ways_agree_roughly(
    found: Recovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    lit = lit_pixels(found)
    small = streaks_of(found, lit)
    monkeypatch.setattr(streak_rows, "FINE_CELLS", 100)
    large = streaks_of(found, lit)
    assert {type(one) for one in small} == {PixelStreaks}
    assert {type(one) for one in large} == {CellStreaks}
    one, other = _under(small), _under(large)
    assert one.sum() == pytest.approx(other.sum(), rel=0.15)
    assert np.corrcoef(one.ravel(), other.ravel())[0, 1] > 0.9


def test_streaks_taken_away_pixel_by_pixel_leave_less_than_those_of_cells(
    found: Recovery, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full planes, so that no demosaic is judged; away from the lamps and their blur."""
    scene = with_lamps(street(*SIZE), LAMPS)
    light = blurred(scene, star())
    lit = lit_pixels(found)
    left = {}
    rows, columns = np.indices(SIZE)
    away = np.min([np.hypot(rows - y, columns - x) for y, x, _, _ in LAMPS], axis=0) > 12
    for cells in (2**20, 100):
        monkeypatch.setattr(streak_rows, "FINE_CELLS", cells)
        rest = light - _under(streaks_of(found, lit)) - blurred(street(*SIZE), star())
        left[cells] = float(np.std(np.diff(rest[:, away], axis=1)))
    assert left[2**20] < 0.7 * left[100]


def test_streaks_of_cells_end_with_their_window() -> None:
    clipped = np.zeros((COLOURS, 20, 24), np.float32)
    clipped[:, 9, 11] = 1
    whole = one_light(clipped, (0.5, 0.5))
    window = Window(top=6, bottom=13, left=7, right=16)
    part = replace(
        whole.regions[0],
        window=window,
        light=np.zeros((COLOURS, *window.shape), np.float32),
        streaks=np.full((COLOURS, *window.shape), 0.125, np.float32),
    )
    got = _under([CellStreaks(part, ((0.5, 0.5),) * COLOURS)], (40, 48))
    inside = np.zeros((40, 48), np.bool_)
    inside[2 * 6 - 1 : 2 * 13 + 1, 2 * 7 - 1 : 2 * 16 + 1] = True
    assert (got[:, ~inside] == 0).all()
    assert (got[:, 14:17, 16:19] == 0.125).all()


def test_halves_are_those_of_numpy_subnormal_ones_and_zeros_too() -> None:
    rng = np.random.default_rng(0)
    sizes = np.float32(10) ** rng.uniform(-10, 6, 20_000).astype(np.float32)
    ties = np.float32([0.5, 1.5, 2.5, 1023.5, 1024, 1024.5]) * np.float32(2.0**-24)
    plane = np.concatenate([sizes, ties, np.float32([0])])
    plane = np.stack([plane, -plane])
    expected = np.clip(plane, -BRIGHTEST, BRIGHTEST).astype(np.float16)
    assert np.array_equal(_half(plane).view(np.uint16), expected.view(np.uint16))

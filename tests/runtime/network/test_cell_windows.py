"""Networks on lattice cells: the bits of the untiled run there, what stands in elsewhere."""

import threading

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError, MemoryCapError
from camkit.runtime.cancel import Cancelled
from camkit.runtime.network.cell_windows import (
    RAMP_PX,
    CellLayout,
    CellLimits,
    CellNetwork,
    infer_cells,
    lay_cells,
)
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.tiling import PixelCost
from camkit.runtime.rows import ArrayRows
from tests.small_network import HALO_PX, STRIDE_PX, small_network

CELL = 128
ENGINES = {n: NetworkEngine(small_network(), threads=n) for n in (1, 2)}
LABELS = np.array([[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 1]])
SIZE = (3 * CELL - 30, 4 * CELL - 7)
COST = PixelCost(arena_bytes=100.0)
RESTORED = slice(3, 6)
"""Channels of the input that stand in where no network runs."""


def _network(threads: int = 1, **changes: object) -> CellNetwork:
    values = {"run": ENGINES[threads].run, "stride_px": STRIDE_PX, "halo_px": HALO_PX}
    return CellNetwork(cost=COST, **(values | changes))  # type: ignore[arg-type]


def _limits(max_bytes: int = 2**32, tile_px: int | None = None) -> CellLimits:
    return CellLimits(cell_px=CELL, max_bytes=max_bytes, tile_px=tile_px)


def _picture(size: tuple[int, int] = SIZE) -> FloatArray:
    picture: FloatArray = np.random.default_rng(0).random((6, *size)).astype(np.float32)
    return picture


def _whole(picture: FloatArray) -> FloatArray:
    _, height, width = picture.shape
    pad = ((0, 0), (0, -height % STRIDE_PX), (0, -width % STRIDE_PX))
    padded = np.ascontiguousarray(np.pad(picture, pad, mode="edge"))[None]
    return ENGINES[1].run(padded)[0, :, :height, :width]


def _infer(networks: list[CellNetwork], picture: FloatArray, layout: CellLayout) -> FloatArray:
    bands = infer_cells(networks, ArrayRows(picture), layout, stand_in=RESTORED)
    return np.concatenate(list(bands), axis=1)


def _slices(i: int, j: int, inset: int = 0) -> tuple[slice, slice]:
    return (
        slice(i * CELL + inset, min((i + 1) * CELL, SIZE[0]) - inset),
        slice(j * CELL + inset, min((j + 1) * CELL, SIZE[1]) - inset),
    )


def test_chosen_cells_have_the_bits_of_the_untiled_network() -> None:
    picture = _picture()
    whole = _whole(picture)
    network = _network()
    got = _infer([network], picture, lay_cells(SIZE, LABELS, [network], _limits()))
    around = np.pad(LABELS > 0, 1, mode="edge")
    for i, j in np.argwhere(LABELS > 0):
        inset = 0 if around[i : i + 3, j : j + 3].all() else RAMP_PX
        rows, columns = _slices(int(i), int(j), inset)
        np.testing.assert_array_equal(got[:, rows, columns], whole[:, rows, columns])


def test_other_cells_keep_the_planes_that_stand_in() -> None:
    picture = _picture()
    network = _network()
    got = _infer([network], picture, lay_cells(SIZE, LABELS, [network], _limits()))
    for i, j in np.argwhere(LABELS == 0):
        rows, columns = _slices(int(i), int(j))
        np.testing.assert_array_equal(got[:, rows, columns], picture[3:, rows, columns])


def test_ramp_passes_from_the_stand_in_to_the_network_inside_the_cell() -> None:
    picture = np.zeros((6, 2 * CELL, 2 * CELL), np.float32)
    network = CellNetwork(
        run=lambda window: np.ones((1, 3, *window.shape[2:]), np.float32),
        stride_px=1,
        halo_px=0,
        cost=COST,
    )
    labels = np.array([[0, 1], [0, 1]])
    got = _infer([network], picture, lay_cells((2 * CELL, 2 * CELL), labels, [network], _limits()))
    at = (np.arange(CELL) + 0.5) / RAMP_PX
    smooth = np.where(at < 1, at * at * (3 - 2 * at), 1.0)
    np.testing.assert_allclose(got[0, 5, CELL:], smooth, atol=1e-6)
    assert (got[:, :, :CELL] == 0).all()


def test_result_does_not_depend_on_tile_memory_or_threads() -> None:
    picture = _picture()
    networks = [_network(), _network()]
    labels = np.where(LABELS > 0, LABELS + (np.indices(LABELS.shape)[1] % 2), 0)
    wanted = _infer(networks, picture, lay_cells(SIZE, labels, networks, _limits()))
    for tile_px in (CELL, 2 * CELL, 4 * CELL):
        layout = lay_cells(SIZE, labels, networks, _limits(tile_px=tile_px))
        other = _infer([_network(2), _network(2)], picture, layout)
        np.testing.assert_array_equal(other, wanted)
    tight = lay_cells(SIZE, labels, networks, _limits(max_bytes=16_000_000))
    assert tight.window_count > lay_cells(SIZE, labels, networks, _limits()).window_count
    np.testing.assert_array_equal(_infer(networks, picture, tight), wanted)


@pytest.mark.parametrize("seed", range(8))
def test_windows_serve_every_chosen_cell_with_its_halo(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = (int(rng.integers(1, 900)), int(rng.integers(1, 900)))
    shape = tuple(-(-side // CELL) for side in size)
    labels = rng.integers(0, 3, shape)
    networks = [_network(halo_px=int(rng.integers(0, 60))) for _ in range(2)]
    layout = lay_cells(size, labels, networks, _limits(tile_px=int(rng.choice([128, 300, 900]))))
    served = np.zeros((2, *shape), int)
    for windows in layout.strips:
        for window in windows:
            top, left, bottom, right = window.cells
            served[window.network, top:bottom, left:right] += 1
            halo = networks[window.network].halo_px
            edges = zip(window.pixels, window.cells, strict=True)
            for axis, (pixel, cell) in enumerate(edges):
                limit = layout.padded_px[axis % 2]
                assert pixel % STRIDE_PX == 0
                if axis < 2:
                    assert 0 <= pixel <= max(cell * CELL - halo, 0)
                else:
                    assert min(cell * CELL + halo, limit) <= pixel <= limit
    for number in (0, 1):
        assert (served[number][labels == number + 1] == 1).all()


def test_a_lone_cell_costs_its_halo_and_a_gap_is_worth_bridging() -> None:
    network = _network(halo_px=64)
    labels = np.zeros((4, 8), int)
    labels[0, 0] = labels[0, 7] = 1
    apart = lay_cells((512, 1024), labels, [network], _limits())
    assert apart.window_count == 2
    labels[0, 6:] = labels[0, :2] = 1
    labels[0, 3] = 1
    bridged = lay_cells((512, 1024), labels, [network], _limits())
    # Cells 0, 1 and 3: one window across the gap costs less than a halo between two.
    assert bridged.window_count == 2
    assert bridged.area_px(0) <= (4 * CELL + 64) * (CELL + 64) + (2 * CELL + 64) * (CELL + 64)


def test_needed_bytes_hold_rows_and_the_largest_window() -> None:
    network = _network()
    layout = lay_cells(SIZE, LABELS, [network], _limits())
    largest = max(w.area_px for windows in layout.strips for w in windows)
    rows = 24 * layout.buffer_rows * layout.padded_px[1]
    assert layout.needed_bytes([COST]) >= rows + 100 * largest


def test_not_finite_output_names_its_window() -> None:
    network = _network(run=lambda w: np.full((1, 3, *w.shape[2:]), np.nan, np.float32))
    layout = lay_cells(SIZE, LABELS, [network], _limits())
    with pytest.raises(ContractError, match=r"window x 0\.\."):
        _infer([network], _picture(), layout)


def test_cancel_stops_before_the_next_window() -> None:
    network = _network()
    layout = lay_cells(SIZE, LABELS, [network], _limits(tile_px=CELL))
    flag, seen = threading.Event(), []

    def progress(done: int, total: int) -> None:
        seen.append((done, total))
        flag.set()

    bands = infer_cells(
        [network],
        ArrayRows(_picture()),
        layout,
        progress=progress,
        cancel=flag,
        stand_in=RESTORED,
    )
    with pytest.raises(Cancelled, match="stopped on request"):
        list(bands)
    assert seen == [(1, layout.window_count)]


def test_what_does_not_fit_is_refused() -> None:
    network = _network()
    with pytest.raises(ContractError, match="labels"):
        lay_cells((999, 999), LABELS, [network], _limits())
    with pytest.raises(MemoryCapError, match="MB for one cell") as refused:
        lay_cells(SIZE, LABELS, [network], _limits(max_bytes=1000))
    lay_cells(SIZE, LABELS, [network], _limits(max_bytes=refused.value.need_bytes))
    layout = lay_cells(SIZE, LABELS, [network], _limits())
    with pytest.raises(ContractError, match="layout is for"):
        _infer([network], _picture((64, 64)), layout)

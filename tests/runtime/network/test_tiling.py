"""Tiling: plans that keep every pixel once, and tiles that equal the whole bit for bit."""

import threading
import weakref
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.errors import CamkitError, ContractError, MemoryCapError
from camkit.runtime.cancel import Cancelled
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.tiling import (
    BANDS_HELD,
    PIECE_ROWS,
    PixelCost,
    Span,
    TileLayout,
    TileLimits,
    infer_bands,
    lay_windows,
)
from camkit.runtime.rows import ArrayRows
from tests.planes_bundle import finer_network
from tests.small_network import HALO_PX, STRIDE_PX, small_network

ENGINES = {n: NetworkEngine(small_network(), threads=n) for n in (1, 2)}
LIMITS = TileLimits(stride_px=STRIDE_PX, halo_px=HALO_PX)
ROOMY = 2**40


def _limits(**changes: object) -> TileLimits:
    values = {"stride_px": STRIDE_PX, "halo_px": HALO_PX, **changes}
    return TileLimits(**values)  # type: ignore[arg-type]


def _picture(height: int, width: int, seed: int = 0) -> FloatArray:
    picture: FloatArray = np.random.default_rng(seed).random((6, height, width)).astype(np.float32)
    return picture


def _infer(
    run: Callable[[FloatArray], FloatArray], picture: FloatArray, limits: TileLimits
) -> FloatArray:
    layout = lay_windows(picture.shape[1], picture.shape[2], limits)
    return np.concatenate(list(infer_bands(run, ArrayRows(picture), layout)), axis=1)


def _assert_sound(layout: TileLayout) -> None:
    axes = (
        (layout.rows, layout.window_height_px, layout.padded_height_px),
        (layout.columns, layout.window_width_px, layout.padded_width_px),
    )
    for spans, window, padded in axes:
        assert spans[0].start_px == 0
        assert spans[-1].stop_px == padded
        for before, after in pairwise(spans):
            assert before.stop_px == after.start_px
        for span in spans:
            end = span.origin_px + window
            assert 0 <= span.origin_px <= span.start_px < span.stop_px <= end <= padded
            assert span.origin_px % layout.stride_px == span.start_px % layout.stride_px == 0
            assert span.origin_px == 0 or span.start_px - span.origin_px >= layout.halo_px
            assert end == padded or end - span.stop_px >= layout.halo_px


sides = st.integers(1, 9000)


@given(
    height=sides,
    width=sides,
    stride=st.sampled_from([1, 4, 8, 16]),
    halo=st.integers(0, 140),
    megabytes=st.integers(8, 2000),
)
@settings(max_examples=60, deadline=None)
def test_plan_keeps_every_pixel_once_with_its_halo_within_memory(
    height: int, width: int, stride: int, halo: int, megabytes: int
) -> None:
    limits = TileLimits(stride_px=stride, halo_px=halo, max_bytes=megabytes * 10**6)
    try:
        layout = lay_windows(height, width, limits)
    except ContractError as error:
        assert "need at least" in str(error)  # noqa: PT017 - both outcomes are in order
        return
    _assert_sound(layout)
    assert layout.halo_px >= halo
    assert layout.needed_bytes(limits.cost) <= limits.max_bytes


@given(height=sides, width=sides, halo=st.integers(0, 140), tile=st.integers(1, 2000))
@settings(max_examples=60, deadline=None)
def test_forced_tiles_keep_every_pixel_once(height: int, width: int, halo: int, tile: int) -> None:
    limits = TileLimits(stride_px=16, halo_px=halo, tile_px=tile)
    _assert_sound(lay_windows(height, width, limits))


def test_plan_of_24_megapixels_wastes_less_than_half() -> None:
    cost = PixelCost(arena_bytes=183)
    limits = TileLimits(stride_px=16, halo_px=94, cost=cost, max_bytes=560 * 10**6)
    layout = lay_windows(4000, 6000, limits)
    assert layout.work_ratio < 1.45
    assert layout.needed_bytes(cost) <= 560 * 10**6


def test_more_memory_never_means_more_work() -> None:
    caps = [m * 10**6 for m in (250, 400, 600, 900, 1500, 6000)]
    ratios = [
        lay_windows(4000, 6000, TileLimits(stride_px=16, halo_px=96, max_bytes=cap)).work_ratio
        for cap in caps
    ]
    assert ratios == sorted(ratios, reverse=True)
    assert ratios[-1] < 1.01


def test_small_picture_is_one_window() -> None:
    layout = lay_windows(31, 17, LIMITS)
    assert (layout.window_count, layout.window_height_px, layout.window_width_px) == (1, 32, 20)


def test_whole_is_one_window_of_the_padded_picture() -> None:
    layout = lay_windows(3999, 1001, _limits(whole=True, max_bytes=ROOMY))
    assert (layout.window_count, layout.window_height_px, layout.window_width_px) == (1, 4000, 1004)


def test_cap_too_small_names_what_is_needed() -> None:
    with pytest.raises(MemoryCapError, match=r"need at least \d+ MB .* got 1 MB") as refused:
        lay_windows(4000, 6000, _limits(max_bytes=2**20))
    need = refused.value.need_bytes
    assert lay_windows(4000, 6000, _limits(max_bytes=need)).window_count > 1
    with pytest.raises(MemoryCapError):
        lay_windows(4000, 6000, _limits(max_bytes=need - 1))


@pytest.mark.parametrize(
    "changes",
    [{"stride_px": 0}, {"halo_px": -1}, {"cost": PixelCost(arena_bytes=0.0)}, {"tile_px": 0}],
)
def test_limits_out_of_range_are_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ContractError, match="must be >"):
        _limits(**changes)


@pytest.mark.parametrize(("height", "width"), [(0, 5), (5, 0)])
def test_empty_picture_is_refused(height: int, width: int) -> None:
    with pytest.raises(ContractError, match="at least 1x1"):
        lay_windows(height, width, LIMITS)


@pytest.mark.parametrize(
    "spans",
    [
        (Span(origin_px=0, start_px=0, stop_px=8), Span(origin_px=4, start_px=12, stop_px=20)),
        (Span(origin_px=0, start_px=0, stop_px=8), Span(origin_px=2, start_px=8, stop_px=20)),
    ],
)
def test_plan_with_a_gap_or_off_the_lattice_cannot_be_made(spans: tuple[Span, ...]) -> None:
    with pytest.raises(ContractError, match="must"):
        TileLayout(
            height_px=20,
            width_px=20,
            stride_px=4,
            halo_px=4,
            window_height_px=16,
            window_width_px=20,
            rows=spans,
            columns=(Span(origin_px=0, start_px=0, stop_px=20),),
        )


@given(
    height=st.integers(1, 260),
    width=st.integers(1, 260),
    tile=st.integers(1, 128),
    threads=st.sampled_from([1, 2]),
    seed=st.integers(0, 5),
)
@settings(max_examples=60, deadline=None)
def test_tiled_equals_whole_bit_for_bit(
    height: int, width: int, tile: int, threads: int, seed: int
) -> None:
    picture = _picture(height, width, seed)
    whole = _infer(ENGINES[1].run, picture, _limits(whole=True))
    assert whole.shape == (3, height, width)
    tiled = _infer(ENGINES[threads].run, picture, _limits(tile_px=tile))
    assert np.array_equal(tiled, whole)


@pytest.mark.parametrize("size", [(1, 1), (17, 31), (1, 4000), (4000, 1), (601, 1103)])
@pytest.mark.parametrize("tile", [256, 512, 1024])
def test_tiled_equals_whole_at_odd_sizes(size: tuple[int, int], tile: int) -> None:
    picture = _picture(*size)
    whole = _infer(ENGINES[2].run, picture, _limits(whole=True, max_bytes=ROOMY))
    for engine in ENGINES.values():
        assert np.array_equal(_infer(engine.run, picture, _limits(tile_px=tile)), whole)


@pytest.mark.slow
@pytest.mark.parametrize("tile", [256, 512, 1024])
def test_tiled_equals_whole_at_4001_by_2999(tile: int) -> None:
    picture = _picture(2999, 4001)
    whole = _infer(ENGINES[2].run, picture, _limits(whole=True, max_bytes=ROOMY))
    for engine in ENGINES.values():
        assert np.array_equal(_infer(engine.run, picture, _limits(tile_px=tile)), whole)


def test_planned_windows_equal_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = _picture(500, 700)
    whole = _infer(ENGINES[1].run, picture, _limits(whole=True, max_bytes=ROOMY))
    limits = _limits(max_bytes=12 * 10**6)
    assert lay_windows(500, 700, limits).window_count > 4
    assert np.array_equal(_infer(ENGINES[1].run, picture, limits), whole)


@pytest.mark.parametrize("stride", [1, 3, 16])
@pytest.mark.parametrize("share", [1.0, 0.5, 0.05])
def test_a_network_that_looks_at_single_cells_runs_as_rarely_as_its_memory_allows(
    stride: int, share: float
) -> None:
    whole = lay_windows(600, 903, TileLimits(stride_px=stride, halo_px=0, max_bytes=ROOMY))
    assert whole.window_count == 1
    cap = int(share * whole.needed_bytes(PixelCost()))
    layout = lay_windows(600, 903, TileLimits(stride_px=stride, halo_px=0, max_bytes=cap))
    assert layout.needed_bytes(PixelCost()) <= cap
    assert layout.window_count <= 2 / share


def test_halo_below_the_reach_does_differ() -> None:
    picture = _picture(200, 200)
    whole = _infer(ENGINES[1].run, picture, _limits(whole=True))
    short = _infer(ENGINES[1].run, picture, _limits(halo_px=HALO_PX - STRIDE_PX, tile_px=64))
    assert 0 < np.abs(short - whole).max() < 1


class _Watched(ArrayRows):
    """Rows that remember what was read."""

    def __init__(self, planes: FloatArray) -> None:
        super().__init__(planes)
        self.reads: list[tuple[int, int]] = []

    def read(self, top: int, bottom: int) -> FloatArray:
        self.reads.append((top, bottom))
        return super().read(top, bottom)


def test_every_row_is_read_once_from_top_to_bottom_and_no_earlier_than_needed() -> None:
    source = _Watched(_picture(333, 50))
    layout = lay_windows(333, 50, _limits(tile_px=64))
    bands = infer_bands(lambda w: w[:, 3:], source, layout)
    first = next(bands)
    assert source.reads[-1][1] == layout.window_height_px
    rest = list(bands)
    assert source.reads[0][0] == 0
    assert source.reads[-1][1] == 333
    assert all(a[1] == b[0] for a, b in pairwise(source.reads))
    assert sum(piece.shape[1] for piece in (first, *rest)) == 333
    assert all(piece.shape[1] <= PIECE_ROWS for piece in (first, *rest))


def test_pieces_of_a_band_are_let_go_of_one_by_one() -> None:
    layout = lay_windows(333, 50, _limits(tile_px=240))
    bands = infer_bands(lambda w: w[:, 3:].copy(), _Watched(_picture(333, 50)), layout)
    given = [weakref.ref(piece) for piece in bands]
    assert len(given) > len(layout.rows)
    assert [ref() for ref in given[:-1]] == [None] * (len(given) - 1)


@given(height=st.integers(1, 300), width=st.integers(1, 100), tile=st.integers(1, 90))
@settings(max_examples=40, deadline=None)
def test_identity_network_gives_the_picture_back(height: int, width: int, tile: int) -> None:
    picture = _picture(height, width)
    result = _infer(lambda w: w[:, 3:].copy(), picture, _limits(tile_px=tile))
    assert np.array_equal(result, picture[3:])


def test_far_sides_are_padded_with_the_edge() -> None:
    seen: list[FloatArray] = []

    def run(window: FloatArray) -> FloatArray:
        seen.append(window.copy())
        return window[:, 3:]

    picture = _picture(5, 6)
    _infer(run, picture, LIMITS)
    assert np.array_equal(seen[0][0], np.pad(picture, ((0, 0), (0, 3), (0, 2)), mode="edge"))


def test_progress_counts_every_window() -> None:
    layout = lay_windows(200, 200, _limits(tile_px=64))
    calls: list[tuple[int, int]] = []
    bands = infer_bands(
        lambda w: w[:, 3:],
        ArrayRows(_picture(200, 200)),
        layout,
        progress=lambda done, total: calls.append((done, total)),
    )
    list(bands)
    assert calls == [(i + 1, layout.window_count) for i in range(layout.window_count)]


@pytest.mark.parametrize("kind", ["event", "function"])
def test_cancel_stops_before_the_next_window(kind: str) -> None:
    flag, done = threading.Event(), []

    def progress(count: int, _: int) -> None:
        done.append(count)
        if count == 2:
            flag.set()

    layout = lay_windows(200, 200, _limits(tile_px=64))
    bands = infer_bands(
        lambda w: w[:, 3:],
        ArrayRows(_picture(200, 200)),
        layout,
        progress=progress,
        cancel=flag if kind == "event" else flag.is_set,
    )
    with pytest.raises(Cancelled, match="stopped on request") as caught:
        list(bands)
    assert isinstance(caught.value, CamkitError)
    assert done == [1, 2]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_value_that_is_not_finite_names_its_tile(value: float) -> None:
    picture = _picture(200, 200)
    picture[4, 130, 90] = value
    with pytest.raises(ContractError, match=r"tile \(row 2, column 1\)"):
        _infer(lambda w: w[:, 3:], picture, _limits(tile_px=64))


def test_plan_for_another_size_is_refused() -> None:
    layout = lay_windows(20, 30, LIMITS)
    with pytest.raises(ContractError, match="layout is for 30x20, the picture 20x30"):
        next(infer_bands(ENGINES[1].run, ArrayRows(_picture(30, 20)), layout))


# ---------------------------------------------------------------------------- finer outputs

FINER = {s: NetworkEngine(finer_network(4, 3, scale=s), threads=1, scale=s) for s in (1, 2, 3)}


def _infer_finer(scale: int, picture: FloatArray, **changes: object) -> FloatArray:
    limits = _limits(stride_px=2, halo_px=3, **changes)
    layout = lay_windows(picture.shape[1], picture.shape[2], limits)
    bands = infer_bands(FINER[scale].run, ArrayRows(picture), layout, scale=scale)
    return np.concatenate(list(bands), axis=1)


@given(
    height=st.integers(1, 90),
    width=st.integers(1, 90),
    tile=st.integers(1, 40),
    scale=st.sampled_from([1, 2, 3]),
)
@settings(max_examples=40, deadline=None)
def test_tiled_equals_whole_bit_for_bit_at_any_scale(
    height: int, width: int, tile: int, scale: int
) -> None:
    picture = np.random.default_rng(tile).random((4, height, width)).astype(np.float32)
    whole = _infer_finer(scale, picture, whole=True)
    assert whole.shape == (3, scale * height, scale * width)
    padded = np.pad(picture, ((0, 0), (0, height % 2), (0, width % 2)), mode="edge")
    untiled = FINER[scale].run(padded[None])[0, :, : scale * height, : scale * width]
    assert np.array_equal(whole, untiled)
    assert np.array_equal(_infer_finer(scale, picture, tile_px=tile), whole)


def test_a_halo_below_the_reach_does_differ_at_twice_the_size() -> None:
    picture = np.random.default_rng(0).random((4, 80, 80)).astype(np.float32)
    whole = _infer_finer(2, picture, whole=True)
    limits = _limits(stride_px=2, halo_px=0, tile_px=32)
    layout = lay_windows(80, 80, limits)
    bands = infer_bands(FINER[2].run, ArrayRows(picture), layout, scale=2)
    assert not np.array_equal(np.concatenate(list(bands), axis=1), whole)


def test_memory_counts_inputs_outputs_and_the_size_of_the_result() -> None:
    layout = lay_windows(400, 600, _limits(tile_px=128))
    area = layout.window_height_px * layout.window_width_px

    def needed(**changes: float) -> int:
        return layout.needed_bytes(PixelCost(**({"arena_bytes": 100.0} | changes)))  # type: ignore[arg-type]

    base = needed(channels=1, outputs=1, scale=1)
    row = 4 * layout.padded_width_px
    band = max(span.stop_px - span.start_px for span in layout.rows)
    one_input = 4 * area + row * layout.window_height_px
    assert needed(channels=2, outputs=1) - base == one_input
    one_output = 4 * area + row * BANDS_HELD * band
    assert needed(channels=1, outputs=2) - base == one_output
    assert needed(channels=1, outputs=1, scale=2) - base == 3 * one_output
    assert needed(channels=1, outputs=1, scale=3) == needed(channels=1, outputs=9)


def test_a_larger_result_is_planned_in_smaller_windows() -> None:
    cap = 60 * 10**6
    areas = []
    for scale in (1, 2, 4):
        cost = PixelCost(arena_bytes=100.0, channels=3, outputs=3, scale=scale)
        limits = _limits(cost=cost, max_bytes=cap)
        layout = lay_windows(1000, 1500, limits)
        assert layout.needed_bytes(cost) <= cap
        areas.append(layout.window_height_px * layout.window_width_px)
    assert areas[0] > areas[1] > areas[2]

"""The windows of networks: their halo by mode, their memory, their numbers, and their picture."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.facts import HaloError, Port
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.windows import (
    NetworkWindows,
    SizedNetwork,
    WindowLimits,
    fast_halo_px,
    lay_network,
)
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import tiny_facts, tiny_forward
from tests.planes_bundle import facts_of, finer_network

SIZE_PX = (64, 96)
CURVE = tuple(
    HaloError(halo_px=halo, max_abs=error, psnr_db=psnr)
    for halo, error, psnr in ((0, 0.1, 40.0), (1, 1e-3, 79.0), (2, 1e-5, 90.0), (3, 0.0, None))
)


def _run(window: FloatArray) -> FloatArray:
    return tiny_forward(window[0])[None]


def _network(size: str = "M", bytes_per_pixel: float = 48.0) -> SizedNetwork:
    facts = tiny_facts().model_copy(
        update={"halo_error": CURVE, "bytes_per_pixel": bytes_per_pixel}
    )
    return SizedNetwork(size=size, run=_run, facts=facts)


def _limits(**changes: object) -> WindowLimits:
    values = {"cap_bytes": 10**9, "spent_bytes": 10**8, "mode": "exact", "cell_px": 32}
    return WindowLimits(**(values | changes))  # type: ignore[arg-type]


def _picture() -> FloatArray:
    return np.random.default_rng(1).random((6, *SIZE_PX), dtype=np.float32)


def _result(windows: NetworkWindows) -> FloatArray:
    bands = windows.bands(ArrayRows(_picture()), stand_in=slice(3, 6))
    return np.concatenate(list(bands), axis=1)


def test_fast_takes_the_smallest_halo_that_keeps_80_db() -> None:
    assert fast_halo_px(CURVE) == 2
    assert fast_halo_px(CURVE, 35.0) == 0
    assert fast_halo_px(CURVE, 100.0) == 3, "an exact halo has no PSNR"
    assert (_network().halo_px("fast"), _network().halo_px("exact")) == (2, 3)


def test_fast_without_a_curve_is_refused() -> None:
    with pytest.raises(ContractError, match="use mode exact"):
        fast_halo_px(())


def test_a_cap_below_what_is_spent_names_both() -> None:
    with pytest.raises(ContractError, match=r"cap of 500 MB .* takes 600 MB"):
        lay_network(SIZE_PX, [_network()], _limits(cap_bytes=5 * 10**8, spent_bytes=6 * 10**8))


def test_whole_is_one_window_and_exact_windows_overlap_by_the_halo() -> None:
    whole = lay_network(SIZE_PX, [_network()], _limits(mode="whole"))
    tiled = lay_network(SIZE_PX, [_network()], _limits(tile_px=32))
    pixels_mp = SIZE_PX[0] * SIZE_PX[1] / 1e6
    assert whole.to_json() == {"mode": "whole", "halo_px": 4, "windows": 1, "work_ratio": 1.0}
    assert whole.window_mp() == {"M": pytest.approx(pixels_mp)}
    assert tiled.to_json()["windows"] > 4
    assert tiled.window_mp()["M"] == pytest.approx(
        tiled.to_json()["work_ratio"] * pixels_mp, rel=1e-3
    )
    assert tiled.needed_bytes() < whole.needed_bytes()


def test_tiles_and_cells_of_one_network_give_the_whole_picture() -> None:
    whole = _result(lay_network(SIZE_PX, [_network()], _limits(mode="whole")))
    np.testing.assert_allclose(whole, tiny_forward(_picture()), rtol=1e-6)
    tiled = lay_network(SIZE_PX, [_network()], _limits(tile_px=32))
    np.testing.assert_allclose(_result(tiled), whole, rtol=1e-6)
    everywhere = np.ones((2, 3), np.int64)
    cells = lay_network(SIZE_PX, [_network()], _limits(), everywhere)
    assert cells.tiles is None
    np.testing.assert_allclose(_result(cells), whole, rtol=1e-6)


def test_labels_say_where_which_network_runs_and_zero_leaves_the_planes_that_stand_in() -> None:
    labels = np.array([[0, 0, 1], [0, 0, 2]])
    networks = [_network("M"), _network("S", bytes_per_pixel=12.0)]
    windows = lay_network(SIZE_PX, networks, _limits(), labels)
    np.testing.assert_array_equal(_result(windows)[:, :, :32], _picture()[3:, :, :32])
    facts = windows.to_json()
    assert facts["windows"] == 2
    share = facts["work_ratio"]
    assert share["M"] == share["S"], "one cell each, mirrored"
    assert 1 / 6 < share["M"] < 1
    assert windows.halo_px == 3


def test_whole_mode_ignores_labels() -> None:
    labels = np.zeros((2, 3), np.int64)
    windows = lay_network(SIZE_PX, [_network()], _limits(mode="whole"), labels)
    assert windows.cells is None
    assert windows.to_json()["windows"] == 1


def test_no_windows_at_all_are_refused_when_they_should_run() -> None:
    empty = NetworkWindows(networks=(_network(),), tiles=None, cells=None, mode="exact")
    assert (empty.window_mp(), empty.needed_bytes(), empty.to_json()) == ({}, 0, {})
    with pytest.raises(ContractError, match="tiles or cells"):
        empty.bands(ArrayRows(_picture()))


def _finer(channels: int, outputs: int, scale: int) -> SizedNetwork:
    data = finer_network(channels, outputs, scale=scale)
    ports = [Port(name="a", channels=channels)], [Port(name="b", channels=outputs, scale=scale)]
    engine = NetworkEngine(data, threads=1, scale=scale)
    return SizedNetwork(size="M", run=engine.run, facts=facts_of(data, *ports))


@pytest.mark.parametrize(("channels", "outputs", "scale"), [(1, 1, 1), (4, 2, 2), (2, 5, 3)])
def test_windows_of_any_channels_and_scale_give_the_whole_and_say_their_memory(
    channels: int, outputs: int, scale: int
) -> None:
    network = _finer(channels, outputs, scale)
    cost = network.cost
    assert (cost.channels, cost.outputs, cost.scale) == (channels, outputs, scale)
    assert cost.out_values == outputs * scale**2
    picture = np.random.default_rng(0).random((channels, *SIZE_PX), dtype=np.float32)
    whole, tiled = (
        lay_network(SIZE_PX, [network], _limits(**changes))
        for changes in ({"mode": "whole"}, {"tile_px": 16})
    )
    made = [np.concatenate(list(w.bands(ArrayRows(picture))), axis=1) for w in (whole, tiled)]
    assert made[0].shape == (outputs, scale * SIZE_PX[0], scale * SIZE_PX[1])
    np.testing.assert_array_equal(*made)
    assert tiled.tiles is not None
    assert tiled.needed_bytes() == tiled.tiles.needed_bytes(cost)
    assert whole.needed_bytes() >= made[0].nbytes


def test_cells_without_planes_that_stand_in_are_refused() -> None:
    labels = np.array([[1, 0, 1], [0, 0, 1]])
    windows = lay_network(SIZE_PX, [_network()], _limits(), labels)
    with pytest.raises(ContractError, match="stand in where no network runs"):
        windows.bands(ArrayRows(_picture()))


def test_any_channels_of_the_input_stand_in_for_a_cell() -> None:
    labels = np.array([[1, 0, 0], [1, 0, 0]])
    windows = lay_network(SIZE_PX, [_finer(5, 2, 1)], _limits(), labels)
    picture = np.random.default_rng(0).random((5, *SIZE_PX), dtype=np.float32)
    bands = list(windows.bands(ArrayRows(picture), stand_in=slice(1, 3)))
    made = np.concatenate(bands, axis=1)
    np.testing.assert_array_equal(made[:, :, 32:], picture[1:3, :, 32:])
    assert (made[:, :, :16] != picture[1:3, :, :16]).any()

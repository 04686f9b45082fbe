"""Probes of a running network: reach and the cost of a short halo."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.probe import halo_error_curve, perturbation_reach
from tests.planes_bundle import finer_network
from tests.small_network import HALO_PX, STRIDE_PX, small_network

RNG = np.random.default_rng


@pytest.fixture(scope="module")
def engine() -> NetworkEngine:
    return NetworkEngine(small_network(), threads=1)


def _box(radius: int) -> object:
    def run(window: FloatArray) -> FloatArray:
        planes = window[:, 3:]
        padded = np.pad(planes, ((0, 0), (0, 0), (radius, radius), (0, 0)))
        return padded[:, :, : planes.shape[2]] + padded[:, :, 2 * radius :] + planes

    return run


def test_reach_of_a_known_filter_is_found_to_the_pixel() -> None:
    reach = perturbation_reach(_box(7), 64, RNG(0), stride_px=1, channels=6)
    assert (reach.radius_px, reach.halo_px) == (7, 7)


def test_halo_on_the_lattice_is_never_more_than_the_radius(engine: NetworkEngine) -> None:
    reach = perturbation_reach(engine.run, 64, RNG(0), stride_px=STRIDE_PX, channels=6)
    assert HALO_PX - STRIDE_PX < reach.halo_px <= HALO_PX
    assert reach.halo_px <= reach.radius_px <= reach.halo_px + STRIDE_PX


def test_network_that_sees_the_whole_window_is_refused() -> None:
    def global_mean(window: FloatArray) -> FloatArray:
        return window[:, 3:] - window[:, 3:].mean(axis=(2, 3), keepdims=True)

    with pytest.raises(ContractError, match="global operator"):
        perturbation_reach(global_mean, 64, RNG(0), stride_px=4, channels=6)


def test_size_off_the_stride_is_refused(engine: NetworkEngine) -> None:
    with pytest.raises(ContractError, match="multiple of 4"):
        perturbation_reach(engine.run, 66, RNG(0), stride_px=STRIDE_PX, channels=6)


def test_error_falls_with_the_halo_and_is_nothing_at_the_reach(engine: NetworkEngine) -> None:
    sample = np.random.default_rng(1).random((6, 150, 140)).astype(np.float32)
    curve = halo_error_curve(engine.run, sample, (0, 7, 8, HALO_PX), stride_px=4, tile_px=32)
    assert [c.halo_px for c in curve] == [0, 8, HALO_PX]
    assert curve[0].max_abs > curve[1].max_abs > 0
    assert curve[0].psnr_db < curve[1].psnr_db
    assert (curve[2].max_abs, curve[2].psnr_db) == (0.0, None)


def test_sample_without_a_seam_is_refused(engine: NetworkEngine) -> None:
    sample = np.zeros((6, 100, 128), np.float32)
    with pytest.raises(ContractError, match="larger than a tile"):
        halo_error_curve(engine.run, sample, (8,), stride_px=STRIDE_PX)


@pytest.mark.parametrize("scale", [1, 2, 3])
@pytest.mark.parametrize("channels", [1, 5])
def test_reach_of_a_finer_output_is_told_in_pixels_of_the_input(scale: int, channels: int) -> None:
    engine = NetworkEngine(finer_network(channels, 2, scale=scale), threads=1, scale=scale)
    reach = perturbation_reach(engine.run, 32, RNG(0), stride_px=2, channels=channels, scale=scale)
    assert reach.halo_px == 3
    assert 3 <= reach.radius_px <= 4


def test_halo_of_a_finer_output_costs_what_its_seams_show() -> None:
    engine = NetworkEngine(finer_network(3, 3, scale=2), threads=1, scale=2)
    sample = RNG(1).random((3, 70, 66)).astype(np.float32)
    curve = halo_error_curve(engine.run, sample, (0, 2, 3), stride_px=2, scale=2, tile_px=32)
    assert [cost.halo_px for cost in curve] == [0, 2, 4]
    assert curve[0].max_abs > curve[1].max_abs > 0
    assert (curve[2].max_abs, curve[2].psnr_db) == (0.0, None)

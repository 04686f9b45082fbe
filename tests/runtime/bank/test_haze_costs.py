"""The costs of the coarse band: memory stays within what is said, and more of all costs more."""

import tracemalloc

import numpy as np
import pytest

from camkit.bundle.stages import Dehaze
from camkit.runtime.bank.haze import few_of, hazy_kernels, solve_coarse
from camkit.runtime.bank.haze_costs import coarse_work, solving_bytes
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.bundle_factory import tiny_psf, tiny_sensor
from tests.haze_factory import tiny_haze


@pytest.mark.parametrize("terms", [1, 32])
def test_no_more_memory_is_taken_than_is_said(terms: int) -> None:
    size_px = 3000, 2000
    window = SensorWindow(size_px=size_px, origin_px=(0, 0), sensor_size_px=size_px, pitch_um=6.0)
    cells = np.random.default_rng(0).random((3, 250, 375), dtype=np.float32)
    kernels = hazy_kernels(tiny_psf(), tiny_haze(), *tiny_sensor().response_arrays())
    said = solving_bytes(Dehaze(shrink=8, terms=terms), tiny_haze(), 3, size_px)
    few_of.cache_clear()
    tracemalloc.start()
    solve_coarse(cells, cells > 2, kernels, window, terms=terms, rounds=2)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0.3 * said < most <= said


def test_more_terms_and_larger_captures_cost_more() -> None:
    few, many = Dehaze(terms=8), Dehaze(terms=64)
    assert coarse_work(many, 3) > 2 * coarse_work(few, 3)
    sizes = [solving_bytes(few, tiny_haze(), 3, size) for size in ((96, 64), (6000, 4000))]
    assert sizes[0] < sizes[1] < solving_bytes(many, tiny_haze(), 3, (6000, 4000))
    assert sizes[0] < solving_bytes(few, tiny_haze(), 3, (96, 64), 4.0)

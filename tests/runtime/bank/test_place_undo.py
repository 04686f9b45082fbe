"""Filters of places: of a point a point, and no round makes errors larger."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.stages import Dehaze
from camkit.haze import Haze
from camkit.runtime.bank.haze import (
    MARGIN_CELLS,
    HazyKernels,
    few_of,
    hazy_kernels,
    solve_coarse,
)
from camkit.runtime.bank.haze_costs import solving_bytes
from camkit.runtime.bank.place_blur import PlaceBlur, lay_nodes
from camkit.runtime.bank.place_undo import DAMPING, cores_differ, filter_side, undoing_kernels
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.bundle_factory import tiny_psf, tiny_sensor
from tests.haze_factory import tiny_haze

WIDTH, HEIGHT = 192, 128


def _sharp_on_the_axis() -> Haze:
    """Give a haze that is nothing on the axis, and nearly all of the light further out."""
    haze = tiny_haze()
    wanted = np.full(haze.core_share.shape, 0.05)
    wanted[0] = 1.0
    kernels = haze.kernels / haze.kernels.sum(axis=(-2, -1), keepdims=True)
    light = (0.99 * (1 - wanted)).astype(np.float32)[..., None, None]
    return replace(haze, kernels=kernels * light, core_share=wanted)


def test_one_filter_serves_cores_of_much_the_same_light() -> None:
    assert not cores_differ(tiny_haze())
    assert cores_differ(_sharp_on_the_axis())


def test_rings_count_by_their_area() -> None:
    # the dull axis is a small part of the frame
    haze = tiny_haze()
    share = np.full(haze.core_share.shape, 0.9)
    share[0] = 0.05
    few = haze.kernels * np.float32(1e-3)
    assert not cores_differ(replace(haze, kernels=few, core_share=share))


def test_the_filter_of_a_point_is_a_point() -> None:
    points = np.zeros((2, 5, 5), np.float32)
    points[:, 2, 2] = 1, 0.3
    made = undoing_kernels(points)
    assert made.shape == (2, filter_side(5), filter_side(5))
    wanted = np.zeros_like(made)
    wanted[:, 4, 4] = 1 / (1 + DAMPING)
    np.testing.assert_allclose(made, wanted, atol=1e-6)


def test_a_filter_undoes_its_kernel() -> None:
    kernel = np.zeros((1, 5, 5), np.float32)
    kernel[0, 2, 1:4] = 0.2, 0.6, 0.2
    (made,) = undoing_kernels(kernel)
    # along the row: kernel upon filter is nearly a point
    both = np.convolve(made.sum(axis=0), kernel[0].sum(axis=0))
    middle = both.size // 2
    assert both[middle] > 0.9
    assert np.abs(np.delete(both, middle)).max() < 0.06


@pytest.fixture(scope="module")
def kernels() -> HazyKernels:
    return hazy_kernels(tiny_psf(), _sharp_on_the_axis(), *tiny_sensor().response_arrays())


def test_every_place_is_solved_where_cores_differ(kernels: HazyKernels) -> None:
    cell_px = kernels.cell_px
    window = SensorWindow(
        size_px=(WIDTH, HEIGHT), origin_px=(0, 0), sensor_size_px=(WIDTH, HEIGHT), pitch_um=6.0
    )
    size = HEIGHT // cell_px, WIDTH // cell_px
    truth = np.random.default_rng(3).uniform(0.1, 0.9, (3, *size)).astype(np.float32)
    laid = window.resampled(cell_px, size[::-1]).widened(MARGIN_CELLS)
    nodes = lay_nodes(kernels.core, laid)
    inner = np.s_[MARGIN_CELLS:-MARGIN_CELLS, MARGIN_CELLS:-MARGIN_CELLS]
    seen = np.empty_like(truth)
    for channel, few in enumerate(few_of(kernels.coarse, 128)):
        blur = PlaceBlur(few, nodes)
        ones = np.ones(laid.size_px[::-1], np.float32)
        wide = np.pad(truth[channel], MARGIN_CELLS, mode="reflect")
        seen[channel] = blur(wide)[inner] / blur(ones)[inner]
    clipped = np.zeros(truth.shape, np.bool_)

    def off(kernels: HazyKernels, rounds: int) -> float:
        band = solve_coarse(seen, clipped, kernels, window, terms=128, rounds=rounds)
        return float(np.sqrt(np.square(band.picture - truth).mean()))

    lost = float(np.sqrt(np.square(seen - truth).mean()))
    assert kernels.differ
    assert off(kernels, 3) < off(kernels, 1) < 0.85 * lost
    # the filter of the mean kernel makes it worse with every round
    mean = replace(kernels, differ=False)
    assert off(mean, 3) > off(mean, 1) > lost


def test_filters_of_places_take_memory() -> None:
    entry, size = Dehaze(), (6000, 4000)
    assert solving_bytes(entry, _sharp_on_the_axis(), 3, size) > 1.5 * solving_bytes(
        entry, tiny_haze(), 3, size
    )

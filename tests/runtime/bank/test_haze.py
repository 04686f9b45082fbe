"""The coarse band: flat stays flat, what a slow model blurs comes back, rows do as the whole."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.runtime.bank.haze import (
    MARGIN_CELLS,
    CoarseBand,
    HazyKernels,
    enlarged,
    hazy_kernels,
    in_cells,
    solve_coarse,
)
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.bundle_factory import tiny_psf, tiny_sensor
from tests.haze_factory import CELL_PX, tiny_haze

FLOAT32 = 2e-6
RESPONSE = tiny_sensor().response_arrays()


def _kernels() -> HazyKernels:
    return hazy_kernels(tiny_psf(), tiny_haze(), *RESPONSE)


def _window(width: int = 96, height: int = 64) -> SensorWindow:
    return SensorWindow(
        size_px=(width, height), origin_px=(0, 0), sensor_size_px=(width, height), pitch_um=6.0
    )


def _solved(cells: FloatArray, over: np.ndarray | None = None, rounds: int = 8) -> CoarseBand:
    clipped = np.zeros(cells.shape, np.bool_) if over is None else over
    return solve_coarse(cells, clipped, _kernels(), _window(), terms=128, rounds=rounds)


def test_light_is_weighed_by_the_response_and_kept() -> None:
    kernels = _kernels()
    np.testing.assert_allclose(kernels.core.kernels.sum(axis=(-2, -1)), 1, atol=FLOAT32)
    # of a channel that sees one wavelength alone, core and haze are that wavelength's
    weights = np.eye(3)[:1]
    alone = hazy_kernels(tiny_psf(), tiny_haze(), tiny_psf().wavelengths_um, weights)
    share = tiny_haze().core_share[:, 0]
    assert (alone.coarse_core.light[:, 0] > share[:, 0] - 0.1).all()
    total = alone.coarse.light - alone.coarse_core.light
    wide = tiny_haze().kernels.sum(axis=(-2, -1), dtype=np.float64)[:, 0]
    assert (np.abs(total[:, 0] - wide[:, 0]) < 0.1).all()


def test_brighter_cores_count_for_more() -> None:
    # two wavelengths that a channel sees alike, of which one is all haze
    psf = replace(
        tiny_psf(),
        kernels=tiny_psf().kernels[:, :, :2],
        wavelengths_um=np.array([0.5, 0.6]),
    )
    haze = tiny_haze(psf)
    share = haze.core_share.copy()
    share[..., 1] = 0.01
    kernels = hazy_kernels(
        psf, replace(haze, core_share=share), np.array([0.5, 0.6]), np.ones((1, 2))
    )
    first = 0.5 * (psf.kernels[0, 0, 0] + psf.kernels[0, 0, 0][:, ::-1])
    second = 0.5 * (psf.kernels[0, 0, 1] + psf.kernels[0, 0, 1][:, ::-1])
    wanted = share[0, 0, 0] * first + share[0, 0, 1] * second
    np.testing.assert_allclose(
        kernels.core.kernels[0, 0], wanted / wanted.sum(), rtol=1e-4, atol=1e-6
    )


def test_kernels_in_cells_are_means_over_a_cell() -> None:
    rng = np.random.default_rng(1)
    kernel = rng.random((5, 5))
    cells = in_cells(kernel, 4)
    wanted = np.zeros((3, 3))
    for y in range(4):
        for x in range(4):
            for dy in range(-2, 3):
                for dx in range(-2, 3):
                    at = (y + dy) // 4 + 1, (x + dx) // 4 + 1
                    wanted[at] += kernel[dy + 2, dx + 2] / 16
    np.testing.assert_allclose(cells, wanted, rtol=1e-12)


@pytest.mark.parametrize("level", [0.0, 0.4])
def test_an_even_picture_stays_even(level: float) -> None:
    band = _solved(np.full((3, 8, 12), level, np.float32))
    np.testing.assert_allclose(band.picture, level, atol=2e-3)
    rows = np.full((3, 64, 96), level, np.float32)
    band.clear(rows, 0)
    np.testing.assert_allclose(rows, level, atol=1e-2)


def _slow_blur(scene: FloatArray, kernels: HazyKernels, channel: int) -> FloatArray:
    """Blur a scene (h, w) in cells with margins by adding every cell's kernel, then even it out."""
    height, width = scene.shape
    laid = _window().resampled(CELL_PX, (width - 2 * MARGIN_CELLS, height - 2 * MARGIN_CELLS))
    laid = laid.widened(MARGIN_CELLS)
    coarse = kernels.coarse
    half = coarse.kernels.kernels.shape[-1] // 2
    out, ones = (np.zeros((height + 2 * half, width + 2 * half)) for _ in range(2))
    for y in range(height):
        for x in range(width):
            place = [float(at) for at in laid.to_mm(float(x), float(y))]
            radius = np.hypot(*place)
            light = np.interp(radius, coarse.kernels.field_heights_mm, coarse.light[:, channel])
            kernel = light * coarse.kernels.at(*place)[channel]
            part = np.s_[y : y + 2 * half + 1, x : x + 2 * half + 1]
            out[part] += scene[y, x] * kernel
            ones[part] += kernel
    inner = np.s_[half + MARGIN_CELLS : -half - MARGIN_CELLS, half + MARGIN_CELLS :]
    made = (out / np.maximum(ones, 1e-9))[inner][:, : width - 2 * MARGIN_CELLS]
    return made.astype(np.float32)


def test_what_a_slow_model_blurs_comes_back() -> None:
    rng = np.random.default_rng(2)
    scene = rng.uniform(0.1, 0.9, (8, 12)).astype(np.float32)
    wide = np.pad(scene, MARGIN_CELLS, mode="reflect")
    seen = np.stack([_slow_blur(wide, _kernels(), c) for c in range(3)])
    band = _solved(seen, rounds=12)
    lost = np.abs(seen - scene).mean()
    for channel in range(3):
        off = np.abs(band.picture[channel] - scene)[1:-1, 1:-1].mean()
        assert off < 0.12 * lost, (channel, off, lost)


def test_a_clipped_light_is_at_least_as_bright_as_it_reads() -> None:
    cells = np.full((3, 8, 12), 0.1, np.float32)
    cells[:, 4, 6] = 1
    over = np.zeros(cells.shape, np.bool_)
    over[:, 4, 6] = True
    plain, known = _solved(cells), _solved(cells, over)
    assert (known.picture[:, 4, 6] >= plain.picture[:, 4, 6] - 1e-3).all()
    assert np.isfinite(known.veil).all()


def test_rows_are_cleared_as_the_whole_is() -> None:
    rng = np.random.default_rng(3)
    band = _solved(rng.random((3, 8, 12), dtype=np.float32))
    picture = rng.random((3, 64, 96), dtype=np.float32)
    whole = picture.copy()
    band.clear(whole, 0)
    parts, top = [], 0
    for height in (1, 7, 20, 36):
        rows = picture[:, top : top + height].copy()
        band.clear(rows, top)
        parts.append(rows)
        top += height
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)
    assert all(rise > 1 for rise in band.noise_rise)


def test_cells_are_enlarged_between_their_middles() -> None:
    cells = np.random.default_rng(4).random((3, 5), dtype=np.float32)
    made = enlarged(cells, 4, np.arange(12), np.arange(20))
    for y, x in ((0, 0), (3, 9), (7, 12), (11, 19)):
        at_y, at_x = np.clip((y + 0.5) / 4 - 0.5, 0, 2), np.clip((x + 0.5) / 4 - 0.5, 0, 4)
        rows = [np.interp(at_x, np.arange(5), row) for row in cells]
        assert made[y, x] == pytest.approx(np.interp(at_y, np.arange(3), rows), abs=1e-6)
    np.testing.assert_allclose(made.reshape(3, 4, 5, 4)[1, :, 2].mean(), cells[1, 2], atol=0.3)


def test_scaled_kernels_reach_as_far_as_the_picture_is_larger() -> None:
    twice = _kernels().scaled(2.0)
    assert twice.core.kernels.shape[-1] > _kernels().core.kernels.shape[-1]
    assert twice.coarse.kernels.kernels.shape[-1] > _kernels().coarse.kernels.kernels.shape[-1]
    np.testing.assert_allclose(twice.coarse.light, _kernels().coarse.light)


def test_a_psf_of_other_samples_is_refused() -> None:
    other: FrozenPsf = replace(tiny_psf(), pixel_pitch_um=5.0)
    with pytest.raises(ContractError, match="haze is of pixels of 6"):
        hazy_kernels(other, tiny_haze(), *RESPONSE)

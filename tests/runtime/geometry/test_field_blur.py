import numpy as np
import pytest
import scipy.signal

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.geometry import field_blur as scatter_module
from camkit.runtime.geometry.field_blur import (
    convolve_full,
    scatter,
    scatter_light,
    scatter_uniform,
)
from camkit.runtime.geometry.sensor_window import SensorWindow

FFT_ERROR = 2e-6
MARGIN = 4


def window(width: int, height: int) -> SensorWindow:
    return SensorWindow(
        size_px=(width, height),
        origin_px=(0, 0),
        sensor_size_px=(width, height),
        pitch_um=10.0,
    )


def kernel(seed: int = 0, side: int = 2 * MARGIN + 1) -> FloatArray:
    values = np.random.default_rng(seed).random((3, side, side), dtype=np.float32)
    return values / values.sum(axis=(1, 2), keepdims=True)


def planes(height: int, width: int) -> FloatArray:
    shape = (3, height + 2 * MARGIN, width + 2 * MARGIN)
    return np.random.default_rng(1).random(shape, dtype=np.float32)


@pytest.mark.parametrize(("height", "width"), [(50, 70), (1, 1), (1, 90), (33, 2)])
def test_one_psf_everywhere_is_a_plain_convolution(height: int, width: int) -> None:
    picture, k = planes(height, width), kernel()
    found = scatter(picture, lambda *_: k, window(width, height), margin_px=MARGIN, step_px=16)
    for channel in range(3):
        expected = scipy.signal.convolve2d(picture[channel], k[channel], mode="valid")
        np.testing.assert_allclose(found[channel], expected, atol=FFT_ERROR)


def test_kernels_are_not_flipped() -> None:
    picture = np.zeros((3, 9 + 2 * MARGIN, 9 + 2 * MARGIN), dtype=np.float32)
    picture[:, 4 + MARGIN, 4 + MARGIN] = 1
    k = kernel()
    found = scatter(picture, lambda *_: k, window(9, 9), margin_px=MARGIN)
    np.testing.assert_allclose(found, k, atol=FFT_ERROR)


def test_each_block_gets_the_psf_of_its_centre() -> None:
    asked: list[tuple[float, float]] = []

    def at(x_mm: float, y_mm: float) -> FloatArray:
        asked.append((x_mm, y_mm))
        return kernel()

    size = 2 * 64 - 2 * MARGIN
    scatter(planes(size, size), at, window(size, size), margin_px=MARGIN, step_px=64)
    assert len(asked) == 4
    np.testing.assert_allclose(np.abs(asked), 0.0, atol=1e-9 + 0.5)
    assert sum(x for x, _ in asked) == pytest.approx(0, abs=1e-9)


def test_light_is_neither_lost_nor_made_by_one_psf() -> None:
    picture = np.zeros((3, 40 + 2 * MARGIN, 60 + 2 * MARGIN), dtype=np.float32)
    picture[:, 12:-12, 12:-12] = np.random.default_rng(2).random((3, 24, 44))
    found = scatter(picture, lambda *_: kernel(3), window(60, 40), margin_px=MARGIN, step_px=16)
    np.testing.assert_allclose(found.sum(axis=(1, 2)), picture.sum(axis=(1, 2)), rtol=1e-5)


def test_equal_radiance_stays_equal_whatever_the_kernels() -> None:
    """Kernels whose centroids move from block to block would draw stripes on a grey wall."""
    grey = np.full((3, 40 + 2 * MARGIN, 60 + 2 * MARGIN), 0.4, dtype=np.float32)
    seeds = iter(range(100))
    found = scatter(
        grey, lambda *_: kernel(next(seeds)), window(60, 40), margin_px=MARGIN, step_px=16
    )
    np.testing.assert_allclose(found, 0.4, rtol=1e-5)


def test_psf_changes_smoothly_between_blocks() -> None:
    side = 128
    flat = np.ones((3, side + 2 * MARGIN, side + 2 * MARGIN), dtype=np.float32)

    def dimmed(x_mm: float, y_mm: float) -> FloatArray:
        return kernel() * np.float32(1 + 0.1 * x_mm)

    found = scatter(flat, dimmed, window(side, side), margin_px=MARGIN, step_px=32)
    assert np.abs(np.diff(found, axis=2)).max() < 0.01


def test_threads_do_not_change_the_bits() -> None:
    picture, k = planes(60, 60), kernel()
    one, two = (
        scatter(picture, lambda *_: k, window(60, 60), margin_px=MARGIN, workers=n) for n in (1, 2)
    )
    np.testing.assert_array_equal(one, two)


def test_full_convolution_has_all_the_light() -> None:
    block = np.random.default_rng(5).random((3, 7, 11), dtype=np.float32)
    full, ones = convolve_full([block, np.ones((1, 7, 11), np.float32)], kernel())
    assert full.shape == ones.shape == (3, 15, 19)
    np.testing.assert_allclose(full.sum(axis=(1, 2)), block.sum(axis=(1, 2)), rtol=1e-5)
    np.testing.assert_allclose(ones.sum(axis=(1, 2)), 77, rtol=1e-5)


@pytest.mark.parametrize("channels", [1, 2, 6])
def test_every_channel_is_blurred_by_its_own_kernel_as_if_alone(channels: int) -> None:
    rng = np.random.default_rng(3)
    picture = rng.random((channels, 40 + 2 * MARGIN, 60 + 2 * MARGIN), dtype=np.float32)
    spread = rng.random((channels, 9, 9), dtype=np.float32)
    spread /= spread.sum(axis=(1, 2), keepdims=True)
    place = window(60, 40)
    found = scatter(picture, lambda *_: spread, place, margin_px=MARGIN, step_px=16)
    for c in range(channels):
        alone = scatter(
            picture[c : c + 1],
            lambda *_, c=c: spread[c : c + 1],
            place,
            margin_px=MARGIN,
            step_px=16,
        )
        np.testing.assert_allclose(found[c], alone[0], atol=FFT_ERROR)
        expected = scipy.signal.convolve2d(picture[c], spread[c], mode="valid")
        np.testing.assert_allclose(found[c], expected, atol=FFT_ERROR)


@pytest.mark.parametrize("sides", [(1, 9), (9, 1), (3, 7), (9, 5)])
def test_a_rectangular_kernel_is_a_plain_convolution_too(sides: tuple[int, int]) -> None:
    spread = np.random.default_rng(0).random((1, *sides), dtype=np.float32)
    spread /= spread.sum()
    picture = planes(30, 41)[:1]
    found = scatter(picture, lambda *_: spread, window(41, 30), margin_px=MARGIN, step_px=16)
    expected = scipy.signal.convolve2d(picture[0], spread[0], mode="same")
    inner = expected[MARGIN:-MARGIN, MARGIN:-MARGIN]
    np.testing.assert_allclose(found[0], inner, atol=FFT_ERROR)


def test_blocks_ask_for_the_kernels_of_their_places_from_the_axis() -> None:
    asked: dict[str, list[tuple[float, float]]] = {"plain": [], "moved": []}
    size = 2 * 64 - 2 * MARGIN
    for name, axis_px in (("plain", None), ("moved", (10.0, -50.0))):

        def at(x_mm: float, y_mm: float, name: str = name) -> FloatArray:
            asked[name].append((x_mm, y_mm))
            return kernel()

        place = SensorWindow(
            size_px=(size, size),
            origin_px=(0, 0),
            sensor_size_px=(size, size),
            pitch_um=10.0,
            axis_px=axis_px,
        )
        scatter(planes(size, size), at, place, margin_px=MARGIN, step_px=64)
    middle = (size - 1) / 2
    shift_mm = (np.array([middle, middle]) - [10.0, -50.0]) * 0.01
    np.testing.assert_allclose(asked["moved"], np.array(asked["plain"]) + shift_mm, atol=1e-12)


def test_planes_without_the_margin_are_refused() -> None:
    with pytest.raises(ContractError, match="planes must be"):
        scatter(
            np.zeros((3, 8, 8), np.float32), lambda *_: kernel(), window(8, 8), margin_px=MARGIN
        )


@pytest.mark.parametrize("sides", [(1, 1), (9, 5), (5, 9), (41, 41)])
@pytest.mark.parametrize("tile_px", [16, 64, 2048])
def test_one_kernel_for_all_places_is_the_sum_written_down(
    sides: tuple[int, int], tile_px: int, monkeypatch
) -> None:
    monkeypatch.setattr(scatter_module, "TILE_PX", tile_px)
    rng, margin, size = np.random.default_rng(0), 22, (70, 33)
    kernels = rng.random((2, *sides), dtype=np.float32)
    kernels /= kernels.sum(axis=(1, 2), keepdims=True)
    around = rng.random((2, size[0] + 2 * margin, size[1] + 2 * margin), dtype=np.float32)
    expected = np.zeros((2, *size))
    down, across = (margin + side // 2 for side in sides)
    for row in range(sides[0]):
        for column in range(sides[1]):
            top, left = down - row, across - column
            moved = around[:, top : top + size[0], left : left + size[1]]
            expected += kernels[:, row, column, None, None] * moved
    found = scatter_uniform(around, kernels, margin_px=margin)
    assert (found.shape, found.dtype) == ((2, *size), np.float32)
    np.testing.assert_allclose(found, expected, atol=3e-6)


def test_one_kernel_gives_what_blocks_give_and_no_bit_hangs_on_threads() -> None:
    k = kernel()
    picture = planes(100, 130)
    in_blocks = scatter(picture, lambda *_: k, window(130, 100), margin_px=MARGIN, step_px=32)
    at_once = scatter_uniform(picture, k, margin_px=MARGIN)
    np.testing.assert_allclose(at_once, in_blocks, atol=3e-6)
    np.testing.assert_array_equal(at_once, scatter_uniform(picture, k, margin_px=MARGIN, workers=2))


@pytest.mark.parametrize("shape", [(3, 2 * MARGIN, 60), (3, 60, 2 * MARGIN)])
def test_planes_that_are_all_margin_are_refused(shape: tuple[int, int, int]) -> None:
    with pytest.raises(ContractError, match="do not fit a margin"):
        scatter_uniform(np.zeros(shape, np.float32), kernel(), margin_px=MARGIN)


def test_a_kernel_wider_than_its_margin_is_refused() -> None:
    with pytest.raises(ContractError, match="do not fit a margin"):
        scatter_uniform(planes(20, 20), kernel(side=2 * MARGIN + 3), margin_px=MARGIN)


def test_of_a_kernel_wider_than_the_window_only_what_falls_inside_is_spread() -> None:
    """Light from all of a wide margin, against the sum over every pixel."""
    margin, side, size = 20, 41, 6
    rng = np.random.default_rng(11)
    wide = rng.random((1, side, side), dtype=np.float32)
    picture = rng.random((1, size + 2 * margin, size + 2 * margin), dtype=np.float32)
    place = window(size, size)
    found, light = scatter_light(picture, lambda *_: wide, place, margin_px=margin, step_px=5)
    for got, seen in ((found, picture[0]), (light, np.ones_like(picture[0]))):
        wanted = [
            [
                float((seen[y : y + side, x : x + side] * wide[0, ::-1, ::-1]).sum())
                for x in range(size)
            ]
            for y in range(size)
        ]
        np.testing.assert_allclose(got[0], wanted, rtol=2e-5)

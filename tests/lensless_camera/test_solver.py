"""The scene behind a mask obeys laws of physics, and agrees with a slow, obvious solver."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.signal import fftconvolve

from tests.lensless_camera.solver import Blur, Floats, Settings, Solved, grid_of, solve

SIDE_PX, KERNEL_PX = 48, 49
QUICK = Settings(iterations=30)
THOROUGH = Settings(iterations=300, positive_penalty=1.0, gradient_penalty=0.3)


def speckle(side_px: int = KERNEL_PX, seed: int = 1) -> Floats:
    """Return a kernel as a diffuser makes it: bright lines on dark ground over the whole frame."""
    rough = gaussian_filter(np.random.default_rng(seed).standard_normal((side_px, side_px)), 1.5)
    bright = np.exp(-np.square(rough / (0.3 * rough.std())))
    return np.asarray(bright / bright.sum(), dtype=np.float32)


def wide_scene(seed: int = 2) -> Floats:
    """Return squares and lamps on dark ground, inside the frame and beside it."""
    rng = np.random.default_rng(seed)
    side_px = SIDE_PX + KERNEL_PX - 1
    scene = np.zeros((side_px, side_px), np.float32)
    for x, y in rng.integers(4, side_px - 12, (14, 2)):
        scene[y : y + 8, x : x + 6] += rng.uniform(0.2, 1.0)
    return scene


def capture_of(scene: Floats, kernel: Floats, noise: float = 0.0) -> Floats:
    """Return crop(h * v) by the definition, with noise relative to its mean."""
    clean = fftconvolve(scene.astype(np.float64), kernel.astype(np.float64), mode="valid")
    spread = noise * clean.mean() * np.random.default_rng(5).standard_normal(clean.shape)
    return np.asarray(clean + spread, dtype=np.float32)


def richardson_lucy(capture: Floats, kernel: Floats, rounds: int) -> NDArray[np.float64]:
    """Return the scene slowly: the multiplicative update, with the crop in the model."""
    turned = kernel[::-1, ::-1].astype(np.float64)
    scene = np.full([a + b - 1 for a, b in zip(capture.shape, kernel.shape, strict=True)], 0.1)
    share = fftconvolve(np.ones(capture.shape), turned, mode="full")
    for _ in range(rounds):
        blurred = fftconvolve(scene, kernel, mode="valid")
        scene *= fftconvolve(capture / np.maximum(blurred, 1e-9), turned) / np.maximum(share, 1e-9)
        np.maximum(scene, 0, out=scene)
    return scene


def behind_sensor(scene: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the part of a scene that lies in the frame."""
    inside = slice(KERNEL_PX // 2, KERNEL_PX // 2 + SIDE_PX)
    return scene[inside, inside]


def error(found: NDArray[np.floating], truth: Floats) -> float:
    """Return |found - truth| / |truth| in the frame."""
    missed = behind_sensor(found - truth)
    return float(np.linalg.norm(missed) / np.linalg.norm(behind_sensor(truth)))


def scene_of(solved: Solved) -> Floats:
    """Return what of the grid reaches the sensor."""
    side_px = SIDE_PX + KERNEL_PX - 1
    return solved.scene[:side_px, :side_px]


def test_the_blur_on_the_grid_is_the_convolution_and_nothing_wraps_into_the_crop() -> None:
    rng = np.random.default_rng(0)
    kernel, size_px = rng.random((7, 11)).astype(np.float32), (20, 30)
    blur = Blur(kernel, size_px)
    assert blur.grid_px == grid_of(size_px, kernel.shape)
    scene = rng.random(blur.grid_px).astype(np.float32)
    slow = fftconvolve(scene[:26, :40], kernel, mode="valid")
    np.testing.assert_allclose(blur.of(scene)[blur.window], slow, rtol=1e-5)


def test_with_a_delta_for_a_kernel_the_picture_is_the_capture() -> None:
    kernel = np.zeros((5, 7), np.float32)
    kernel[2, 3] = 1
    capture = np.random.default_rng(0).random((20, 24)).astype(np.float32)
    solved = solve(capture, kernel, Settings(positive_penalty=1.0))
    np.testing.assert_allclose(solved.scene[solved.window], capture, atol=1e-3)
    assert solved.residual < 1e-3


def test_a_known_scene_is_found_as_well_as_by_a_slow_obvious_solver() -> None:
    kernel, truth = speckle(), wide_scene()
    capture = capture_of(truth, kernel, noise=1e-3)
    solved = solve(capture, kernel, THOROUGH)
    slow = richardson_lucy(capture, kernel, 400)
    assert error(scene_of(solved), truth) < error(slow, truth) < 0.4
    assert error(scene_of(solved), truth) < 0.16
    pictures = [behind_sensor(scene).ravel() for scene in (scene_of(solved), slow)]
    assert np.corrcoef(pictures)[0, 1] > 0.9
    missed = fftconvolve(slow, kernel, mode="valid") - capture
    assert solved.residual < np.linalg.norm(missed) / np.linalg.norm(capture) < 0.03


def test_without_the_crop_in_the_model_light_from_beside_the_frame_ruins_the_picture() -> None:
    kernel, truth = speckle(), wide_scene()
    capture = capture_of(truth, kernel, noise=1e-3)
    # a capture that is taken for the whole of the blurred scene, dark beyond
    whole = np.pad(capture, KERNEL_PX // 2)
    cropless = solve(whole, kernel, THOROUGH)
    rows, columns = cropless.window
    inside = cropless.scene[rows, columns]
    with_crop = error(scene_of(solve(capture, kernel, THOROUGH)), truth)
    assert error(inside, truth) > 4 * with_crop > 0


def test_total_variation_makes_a_noisy_scene_smoother_and_truer() -> None:
    kernel, truth = speckle(), wide_scene()
    capture = capture_of(truth, kernel, noise=0.02)
    plain, smooth = (solve(capture, kernel, replace(THOROUGH, tv=tv)) for tv in (0.0, 0.003))
    total = [np.abs(np.diff(scene_of(found), axis=0)).sum() for found in (plain, smooth)]
    assert total[1] < 0.8 * total[0]
    assert error(scene_of(smooth), truth) < 0.5 * error(scene_of(plain), truth) < 0.15


@pytest.mark.parametrize("tv", [0.0, 0.01])
def test_scene_is_nowhere_negative_and_threads_change_no_bit(tv: float) -> None:
    capture = capture_of(wide_scene(), speckle(), noise=0.02) - np.float32(0.02)
    one, two = (
        solve(capture, speckle(), Settings(iterations=8, tv=tv), threads=threads)
        for threads in (1, 2)
    )
    assert one.scene.min() == 0
    assert np.array_equal(one.scene, two.scene)
    assert one.scene.dtype == np.float32


def test_a_scene_is_as_bright_as_its_capture_and_black_stays_black() -> None:
    capture = capture_of(wide_scene(), speckle())
    once, thrice = (solve(np.float32(k) * capture, speckle(), QUICK).scene for k in (1, 3))
    np.testing.assert_allclose(thrice, 3 * once, rtol=1e-2, atol=1e-3)
    black = solve(np.zeros((16, 16), np.float32), speckle(9), Settings(iterations=3))
    assert not black.scene.any()
    assert black.residual == 0


def test_work_ends_where_the_caller_raises() -> None:
    def rounds() -> Iterator[None]:
        yield
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(np.ones((8, 8), np.float32), speckle(5), Settings(), rounds=rounds())

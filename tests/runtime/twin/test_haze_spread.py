"""The twin of a camera with a haze: as a slow sum over the scene says, flat where that is flat."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.haze_spread import BLOCK_PX, HazeLens, hazed, margin_px, mirrored_cells
from camkit.runtime.twin.light import (
    LightOptions,
    lens_of,
    light_of,
    scene_window,
    with_axis_moved,
)
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from tests.bundle_factory import tiny_psf, tiny_sensor
from tests.haze_bundle import write_hazy_bundle
from tests.haze_factory import CELL_PX, CELLS, tiny_haze

FLOAT32 = 2e-6
SENSOR = tiny_sensor()


def _lens(reach: int = CELLS // 2) -> HazeLens:
    kernels = hazy_kernels(tiny_psf(), tiny_haze(), *SENSOR.response_arrays())
    return HazeLens(
        haze_at=kernels.haze.at,
        share_at=kernels.coarse_core.light_at,
        cell_px=CELL_PX,
        reach_cells=reach,
    )


def _scene(seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(0.1, 0.9, (3, 64, 96)).astype(np.float32)


def test_haze_is_the_sum_over_the_cells_of_a_scene() -> None:
    lens, window = _lens(), _window(48, 32)
    around = margin_px(lens, 5)
    assert around == CELL_PX
    planes = np.random.default_rng(1).random((3, 32 + 16, 48 + 16), dtype=np.float32)
    light, ones = hazed(planes, lens, window, around_px=around, ring_px=around)
    # a frame smaller than a block has one kernel, that of the block's middle
    assert BLOCK_PX > 64 + 2 * CELLS * CELL_PX // 2
    cells = planes.reshape(3, 6, 8, 8, 8).mean(axis=(2, 4))
    wide = np.pad(cells, ((0, 0), (3, 3), (3, 3)), mode="symmetric")
    x_mm, y_mm = window.to_mm(23.5, 15.5)
    kernel = lens.haze_at(float(x_mm), float(y_mm))
    wanted = np.zeros((3, 6, 8))
    for y in range(6):
        for x in range(8):
            # light scatters: what arrives here left there by the opposite step
            wanted[:, y, x] = (wide[:, y : y + 7, x : x + 7] * kernel[:, ::-1, ::-1]).sum((1, 2))
    middle = light.reshape(3, 4, 8, 6, 8).mean(axis=(2, 4))
    linear = np.asarray(wanted[:, 1:-1, 1:-1])
    # the mean of what is linear between middles is near the value there
    assert np.abs(middle - linear).max() < 0.1 * linear.max()
    exact = light[:, 3:5, 3:5].mean(axis=(1, 2))
    around_it = wanted[:, 1, 1]
    np.testing.assert_allclose(exact, around_it, rtol=0.05)
    np.testing.assert_allclose(ones[:, 16, 24], kernel.sum(axis=(1, 2)), rtol=1e-4)


def _window(width: int, height: int) -> SensorWindow:
    return SensorWindow(
        size_px=(width, height), origin_px=(24, 16), sensor_size_px=(96, 64), pitch_um=6.0
    )


@given(
    count=st.integers(1, 9),
    beyond=st.integers(0, 30),
    margin=st.integers(0, 3),
    ring=st.integers(0, 3),
)
def test_cells_beyond_a_scene_are_its_mirror_image_as_far_as_they_go(
    count: int, beyond: int, margin: int, ring: int
) -> None:
    ring = min(ring, margin)
    cells = np.pad(np.arange(count + 2 * ring), margin - ring, mode="symmetric")
    scene_px = CELL_PX * (margin - ring), CELL_PX * (margin + count + ring)
    found = mirrored_cells(len(cells), beyond, CELL_PX, scene_px)
    wide = np.pad(np.arange(count + 2 * ring), beyond + margin - ring, mode="symmetric")
    np.testing.assert_array_equal(cells[found], wide)


def test_the_border_is_veiled_by_the_mirror_image_of_the_whole_scene() -> None:
    """A dark rim as wide as the core's margin does not keep the light of the rest away."""
    kernel = _lens().haze_at(0.0, 0.0)
    lens = replace(_lens(), haze_at=lambda *_: kernel)
    scene = np.full((3, 32, 48), 0.02, np.float32)
    scene[:, CELL_PX:-CELL_PX, CELL_PX:-CELL_PX] = 0.8
    near, far = CELL_PX, CELL_PX * (CELLS // 2 + 1)
    mirrored, surrounded = (
        hazed(
            np.pad(scene, ((0, 0), (px, px), (px, px)), mode="symmetric"),
            lens,
            _window(48, 32),
            around_px=px,
            ring_px=ring,
        )[0]
        for px, ring in ((near, 0), (far, far))
    )
    np.testing.assert_allclose(mirrored, surrounded, rtol=1e-5)


@pytest.mark.parametrize("surround_px", [0, 12])
def test_a_flat_scene_falls_flat(surround_px: int) -> None:
    lens = lens_of(tiny_psf(), SENSOR, haze=tiny_haze())
    scene = np.full((3, 40, 56), 0.5, np.float32)
    window = scene_window(scene, SENSOR, None, surround_px=surround_px)
    options = LightOptions(surround_px=surround_px, distort=False)
    light = light_of(scene, SENSOR, lens, window, options)
    assert light.planes.shape == light.clean.shape
    np.testing.assert_allclose(light.planes, light.clean, rtol=1e-4)


def test_a_point_keeps_its_core_and_veils_the_rest() -> None:
    scene = np.full((3, 64, 96), 1e-3, np.float32)
    scene[:, 32, 48] = 50.0
    window = scene_window(scene, SENSOR, None)
    plain, hazy = (
        light_of(
            scene,
            SENSOR,
            lens_of(tiny_psf(), SENSOR, haze=haze),
            window,
            LightOptions(distort=False),
        ).planes
        for haze in (None, tiny_haze())
    )
    near = np.s_[:, 30:35, 46:51]
    share = hazy[near].sum((1, 2)) / plain[near].sum((1, 2))
    assert ((share > 0.35) & (share < 0.7)).all()
    far = np.s_[:, 32, 60:64]
    assert (hazy[far] > 1.5 * plain[far]).all()


def test_the_axis_moves_core_and_haze() -> None:
    lens = lens_of(tiny_psf(), SENSOR, haze=tiny_haze())
    moved = with_axis_moved(lens, 0.1, 0.0)
    assert lens.haze is not None
    assert moved.haze is not None
    np.testing.assert_array_equal(moved.haze.haze_at(0.3, 0.1), lens.haze.haze_at(0.2, 0.1))
    np.testing.assert_array_equal(moved.haze.share_at(0.3, 0.1), lens.haze.share_at(0.2, 0.1))
    np.testing.assert_array_equal(moved.kernels_at(0.3, 0.1), lens.kernels_at(0.2, 0.1))


def test_what_the_twin_blurs_the_stage_clears(tmp_path: Path) -> None:
    bundle = write_hazy_bundle(tmp_path)
    smooth = np.indices((64, 96)).sum(axis=0)
    scene = np.stack([0.3 + 0.2 * np.sin(smooth / (9 + c)) for c in range(3)]).astype(np.float32)
    made = photograph(scene, bundle, SimulationOptions(noise=False, vignette=False, distort=False))
    errors = {}
    for method in ("develop", "haze", "wiener"):
        pipeline = Pipeline(bundle, Options(method=method))
        capture = pipeline.capture_of(
            made.samples, iso=100, white_balance=tuple(made.white_balance), origin_px=(0, 0)
        )
        picture = pipeline.start(capture).fill()
        inner = np.s_[:, 12:-12, 12:-12]
        errors[method] = float(np.abs(picture - scene)[inner].mean())
    assert errors["haze"] < 0.7 * errors["develop"]

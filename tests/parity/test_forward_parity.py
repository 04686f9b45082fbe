"""Torch and the runtime's twin give the same capture; training makes the same noise."""

from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.sensor import BayerSensor, ColorSensor, Extent
from camkit.colorimetry import apply_matrix, camera_from_rec709
from camkit.models_def.sensors.demosaic import mosaic
from camkit.models_def.sensors.exposure import expose as record
from camkit.models_def.sensors.forward import block_centres_px, scatter
from camkit.models_def.training.kind import read_recipe
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.geometry.field_blur import scatter as runtime_scatter
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.twin.exposure import Setting, expose
from camkit.runtime.twin.light import Light, lens_of
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.camera_factory import make_psf, make_sensor
from tests.planes_bundle import planes_sensor
from tests.psf_factory import PITCH_UM, grid_psf, streak_kernel, uniform_psf

PARITY = 1e-5
STEP_PX = 48
RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet.toml"


def block_kernels(
    sensor: ColorSensor, psf: FrozenPsf, window: SensorWindow, step_px: int
) -> torch.Tensor:
    side = psf.kernels.shape[-1]
    margin = side // 2
    width, height = window.size_px
    rows, columns = (
        block_centres_px(n + 2 * margin, margin, step_px=step_px) for n in (height, width)
    )
    y_px, x_px = torch.meshgrid(rows, columns, indexing="ij")
    x_mm, y_mm = window.to_mm(x_px.numpy().ravel(), y_px.numpy().ravel())
    fields = color_kernels(psf, *sensor.response_arrays())
    kernels = torch.from_numpy(np.stack([fields.at(x, y) for x, y in zip(x_mm, y_mm, strict=True)]))
    return kernels.reshape(len(rows), len(columns), len(sensor.channels), side, side)


def assert_blur_agrees(sensor: ColorSensor, psf: FrozenPsf, window: SensorWindow) -> None:
    margin = psf.kernels.shape[-1] // 2
    width, height = window.size_px
    shape = (len(sensor.channels), height + 2 * margin, width + 2 * margin)
    planes = np.random.default_rng(0).random(shape, dtype=np.float32)
    lens = lens_of(psf, sensor)
    assert lens.margin_px == margin
    expected = runtime_scatter(planes, lens.kernels_at, window, margin_px=margin, step_px=STEP_PX)
    kernels = block_kernels(sensor, psf, window, STEP_PX)
    found = scatter(torch.from_numpy(planes), kernels, step_px=STEP_PX)
    assert np.abs(found.numpy() - expected).max() <= PARITY


@pytest.mark.parametrize("size", [(96, 64), (131, 57), (40, 1)])
@pytest.mark.parametrize("axis_px", [None, (120.0, 260.5)])
def test_varying_blur_agrees(size: tuple[int, int], axis_px: tuple[float, float] | None) -> None:
    sensor = make_sensor(400, 300)
    window = SensorWindow(
        size_px=size,
        origin_px=(200, 150),
        sensor_size_px=(400, 300),
        pitch_um=5.96,
        axis_px=axis_px,
    )
    assert_blur_agrees(sensor, make_psf(sensor, side=11), window)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("symmetry", ["uniform", "grid"])
def test_blur_by_streaks_agrees_for_any_number_of_channels(symmetry: str, channels: int) -> None:
    names = ("R", "G", "B") if channels == 3 else tuple("abcd")[:channels]
    extent = Extent(width_px=131, height_px=97, pixel_pitch_um=PITCH_UM)
    sensor = planes_sensor(names, extent=extent)
    psf = uniform_psf(streak_kernel(25.0), (0.5, 0.6), channels)
    if symmetry == "grid":
        turns = (10.0, 80.0, 190.0, 250.0, 300.0, 355.0)
        streaks = np.stack([streak_kernel(turn) for turn in turns]).reshape(2, 3, 21, 21)
        at_mm = np.array([-0.4, 0.1, 0.5]), np.array([-0.3, 0.2])
        psf = grid_psf(streaks, *at_mm, (0.5, 0.6), channels)
    window = SensorWindow(
        size_px=(131, 97), origin_px=(0, 0), sensor_size_px=(131, 97), pitch_um=PITCH_UM
    )
    assert_blur_agrees(sensor, psf, window)


def test_noiseless_capture_agrees() -> None:
    sensor = make_sensor(96, 64)
    psf = make_psf(sensor)
    scene = np.random.default_rng(1).random((3, 64, 96), dtype=np.float32) * 1.6
    options = SimulationOptions(noise=False, distort=False, vignette=False)
    expected = simulate(scene, sensor, psf, options)

    margin = psf.kernels.shape[-1] // 2
    matrix, gains = camera_from_rec709(np.array(sensor.color_matrix))
    inside = apply_matrix(matrix, scene)
    around = np.pad(inside, ((0, 0), (margin, margin), (margin, margin)), mode="reflect")
    planes = torch.from_numpy(np.maximum(around, 0))
    blurred = scatter(planes, block_kernels(sensor, psf, expected.window, 128))
    raw = mosaic(blurred[None] / torch.tensor(gains)[:, None, None], "RGGB")[0].numpy()
    noise = sensor.noise_at(options.iso)
    one_dn = 1 / (sensor.white_level - sensor.black_level)
    found = np.minimum(raw, sensor.full_well_e * noise.shot[1]) / one_dn
    found = np.minimum(np.rint(found + sensor.black_level), sensor.white_level)
    difference = np.abs(found - expected.samples)
    # A signal on the edge of two DN may round either way; nothing else may differ.
    assert (difference > 0).mean() < 1e-3
    assert difference.max() <= 1
    assert (expected.samples == 4095).any()


def test_noise_of_training_and_simulation_has_the_same_spread() -> None:
    recipe = read_recipe(RECIPE)
    sensor, level, gains = recipe.sensor, 0.1, (2.0, 1.0, 1.5)
    assert isinstance(sensor, BayerSensor)
    planes = np.full((3, 300, 300), level, dtype=np.float32)
    window = SensorWindow(
        size_px=(300, 300), origin_px=(0, 0), sensor_size_px=(300, 300), pitch_um=6.0
    )
    light = Light(
        planes=planes, clean=planes, window=window, gains=(1.0, 1.0, 1.0), vignetting=None
    )
    dn = expose(light, sensor, Setting(iso=1600, seed=0))
    signal = (dn.astype(float) - sensor.black_level) / (sensor.white_level - sensor.black_level)
    balanced = torch.tensor(gains).reshape(1, 3, 1, 1) * torch.full((1, 3, 300, 300), level)
    found, _ = record(balanced, gains, sensor, 1600, np.random.default_rng(0))
    assert found.var() == pytest.approx(signal.var(), rel=0.04)
    assert found.mean() == pytest.approx(signal.mean(), abs=2e-4)

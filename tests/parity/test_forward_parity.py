"""Torch and `runtime.simulate` give the same capture; training makes the same noise."""

from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.sensor import BayerSensor
from camkit.colorimetry import camera_from_rec709
from camkit.contracts import FrozenPsf
from camkit.models_def.kinds.bayer import samples as training
from camkit.models_def.sensors.demosaic import mosaic
from camkit.models_def.sensors.forward import block_centres_px, scatter
from camkit.models_def.sensors.psf import color_kernels
from camkit.models_def.training.kind import read_recipe
from camkit.runtime import simulate as runtime
from camkit.runtime.geometry.scatter import scatter as runtime_scatter
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.simulate import SimulationOptions, simulate
from tests.camera_factory import make_psf, make_sensor

PARITY = 1e-5
STEP_PX = 48
RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet.toml"


def block_kernels(
    sensor: BayerSensor, psf: FrozenPsf, window: SensorWindow, step_px: int
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
    kernels = fields.at(torch.from_numpy(x_mm), torch.from_numpy(y_mm))
    return kernels.reshape(len(rows), len(columns), 3, side, side)


@pytest.mark.parametrize("size", [(96, 64), (131, 57), (40, 1)])
def test_varying_blur_agrees(size: tuple[int, int]) -> None:
    sensor = make_sensor(400, 300)
    psf = make_psf(sensor, side=11)
    window = SensorWindow(
        size_px=size, origin_px=(200, 150), sensor_size_px=(400, 300), pitch_um=5.96
    )
    planes = np.random.default_rng(0).random((3, size[1] + 10, size[0] + 10), dtype=np.float32)
    expected = runtime_scatter(
        planes, runtime.kernel_lookup(psf, sensor), window, margin_px=5, step_px=STEP_PX
    )
    kernels = block_kernels(sensor, psf, window, STEP_PX)
    found = scatter(torch.from_numpy(planes), kernels, step_px=STEP_PX)
    assert np.abs(found.numpy() - expected).max() <= PARITY


def test_noiseless_capture_agrees() -> None:
    sensor = make_sensor(96, 64)
    psf = make_psf(sensor)
    scene = np.random.default_rng(1).random((3, 64, 96), dtype=np.float32) * 1.6
    options = SimulationOptions(noise=False, distort=False, vignette=False)
    expected = simulate(scene, sensor, psf, options)

    margin = psf.kernels.shape[-1] // 2
    matrix, gains = camera_from_rec709(np.array(sensor.color_matrix))
    planes = runtime.sensor_scene(scene, matrix, psf, expected.window, options, margin)
    kernels = block_kernels(sensor, psf, expected.window, 128)
    blurred = scatter(torch.from_numpy(planes), kernels)
    raw = mosaic(blurred[None] / torch.tensor(gains)[:, None, None], "RGGB")[0].numpy()
    noise = sensor.noise_at(options.iso)
    one_dn = 1 / (sensor.white_level - sensor.black_level)
    found = np.minimum(raw, sensor.full_well_e * noise.shot[1]) / one_dn
    found = np.minimum(np.rint(found + sensor.black_level), sensor.white_level)
    difference = np.abs(found - expected.mosaic)
    # A signal on the edge of two DN may round either way; nothing else may differ.
    assert (difference > 0).mean() < 1e-3
    assert difference.max() <= 1
    assert (expected.mosaic == 4095).any()


def test_noise_of_training_and_simulation_has_the_same_spread() -> None:
    recipe = read_recipe(RECIPE)
    sensor, level, gains = recipe.sensor, 0.1, (2.0, 1.0, 1.5)
    flat = np.full((300, 300), level, dtype=np.float32)
    dn = runtime.expose(flat, sensor, SimulationOptions(iso=1600, seed=0))
    signal = (dn.astype(float) - sensor.black_level) / (sensor.white_level - sensor.black_level)
    light = torch.tensor(gains).reshape(1, 3, 1, 1) * torch.full((1, 3, 300, 300), level)
    found, _ = training._expose(light, gains, recipe, 1600, np.random.default_rng(0))
    assert found.var() == pytest.approx(signal.var(), rel=0.04)
    assert found.mean() == pytest.approx(signal.mean(), abs=2e-4)

"""Torch and the twin of the runtime give the same capture; training makes the same noise."""

from pathlib import Path

import numpy as np
import pytest
import scipy.signal
import torch

from camkit.bundle.sensor import ColorSensor, PlanesSensor, nested_sensor
from camkit.contracts import FrozenPsf
from camkit.models_def.kinds.bayer import samples as training
from camkit.models_def.sensors.demosaic import mosaic
from camkit.models_def.sensors.forward import block_centres_px, scatter
from camkit.models_def.sensors.psf import color_kernels
from camkit.models_def.training.kind import read_recipe
from camkit.runtime.geometry.scatter import scatter as runtime_scatter
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.twin.exposure import Setting, expose
from camkit.runtime.twin.light import Light, LightOptions, lens_of, light_of, scene_window
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from tests.camera_factory import make_psf, make_sensor, whole_window
from tests.psf_factory import grid_psf, streak_kernel, uniform_psf

PARITY = 1e-5
STEP_PX = 48
RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet.toml"
GREY = {
    "width_px": 400,
    "height_px": 300,
    "pixel_pitch_um": 10.0,
    "channels": ["Y"],
    "black_level": 0.0,
    "white_level": 4095.0,
    "full_well_e": 9000.0,
    "noise": [{"iso": 100.0, "gain_e_per_dn": 2.0, "read_noise_e": 1.0}],
    "channel_response": {"wavelengths_um": [0.55], "response": [[1.0]], "source": ""},
}


def grey_sensor() -> PlanesSensor:
    return PlanesSensor.model_validate(nested_sensor(GREY))


def streaks_on_a_grid() -> FrozenPsf:
    streaks = np.stack([streak_kernel(90.0 * i) for i in range(4)]).reshape(2, 2, 21, 21)
    return grid_psf(streaks, np.array([-1.5, 1.5]), np.array([-1.0, 1.0]))


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
    kernels = fields.at(torch.from_numpy(x_mm), torch.from_numpy(y_mm))
    return kernels.reshape(len(rows), len(columns), -1, side, side)


CAMERAS = {
    "radial": (make_sensor(400, 300), make_psf(make_sensor(400, 300), side=11)),
    "uniform": (grey_sensor(), uniform_psf(streak_kernel(200.0))),
    "grid": (grey_sensor(), streaks_on_a_grid()),
}


@pytest.mark.parametrize("size", [(96, 64), (131, 57), (40, 1)])
@pytest.mark.parametrize(("sensor", "psf"), CAMERAS.values(), ids=CAMERAS.keys())
def test_varying_blur_agrees(sensor: ColorSensor, psf: FrozenPsf, size: tuple[int, int]) -> None:
    window = SensorWindow(
        size_px=size,
        origin_px=(200, 150),
        sensor_size_px=(400, 300),
        pitch_um=sensor.pixel_pitch_um,
    )
    margin, channels = psf.kernels.shape[-1] // 2, len(sensor.channels)
    shape = channels, size[1] + 2 * margin, size[0] + 2 * margin
    planes = np.random.default_rng(0).random(shape, dtype=np.float32)
    lens = lens_of(psf, sensor)
    expected = runtime_scatter(planes, lens.kernels_at, window, margin_px=margin, step_px=STEP_PX)
    kernels = block_kernels(sensor, psf, window, STEP_PX)
    found = scatter(torch.from_numpy(planes), kernels, step_px=STEP_PX)
    assert np.abs(found.numpy() - expected).max() <= PARITY


@pytest.mark.parametrize("turn_deg", [0.0, 90.0, 250.0])
def test_streaks_fall_where_direct_convolution_puts_them_in_both(turn_deg: float) -> None:
    """A point of light throws its streak to one side, in the twin and in training alike."""
    sensor, streak = grey_sensor(), streak_kernel(turn_deg)
    psf, scene = uniform_psf(streak), np.zeros((3, 64, 96), np.float32)
    scene[:, 20, 30] = scene[:, 40, 70] = 0.9
    window = scene_window(scene, sensor, None)
    light = light_of(scene, sensor, lens_of(psf, sensor), window, LightOptions(vignette=False))
    expected = scipy.signal.convolve2d(light.clean[0], streak, "same")
    assert np.abs(light.planes[0] - expected).max() <= PARITY
    margin = ((0, 0), (10, 10), (10, 10))
    planes = torch.from_numpy(np.pad(light.clean, margin))
    found = scatter(planes, block_kernels(sensor, psf, window, 128))
    inner = np.s_[10:-10, 10:-10]
    assert np.abs(found[0].numpy() - expected)[inner].max() <= PARITY


def test_noiseless_capture_agrees() -> None:
    sensor = make_sensor(96, 64)
    psf = make_psf(sensor)
    scene = np.random.default_rng(1).random((3, 64, 96), dtype=np.float32) * 1.6
    options = SimulationOptions(noise=False, distort=False, vignette=False)
    expected = simulate(scene, sensor, psf, options)

    margin = psf.kernels.shape[-1] // 2
    planes = np.pad(expected.clean, ((0, 0), (margin, margin), (margin, margin)), mode="reflect")
    kernels = block_kernels(sensor, psf, expected.window, 128)
    blurred = scatter(torch.from_numpy(planes), kernels)
    gains = torch.tensor(expected.white_balance)[:, None, None]
    raw = mosaic(blurred[None] / gains, "RGGB")[0].numpy()
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
    sensor = recipe.sensor.model_copy(
        update={
            "extent": recipe.sensor.extent.model_copy(update={"width_px": 300, "height_px": 300})
        }
    )
    level, gains = 0.1, (2.0, 1.0, 1.5)
    planes = np.array(gains, np.float32)[:, None, None] * np.full((3, 300, 300), level, np.float32)
    light = Light(
        planes=planes, clean=planes, window=whole_window(sensor), gains=gains, vignetting=None
    )
    dn = expose(light, sensor, Setting(iso=1600, seed=0))
    signal = (dn.astype(float) - sensor.black_level) / (sensor.white_level - sensor.black_level)
    found, _ = training._expose(
        torch.from_numpy(planes)[None], gains, recipe, 1600, np.random.default_rng(0)
    )
    assert found.var() == pytest.approx(signal.var(), rel=0.04)
    assert found.mean() == pytest.approx(signal.mean(), abs=2e-4)

"""A camera photographed as data: its capture is what light and sensor say, and a real RAW file."""

import json
from pathlib import Path

import numpy as np
import pytest
import rawpy
import tifffile

from camkit.arrays import FloatArray
from camkit.colorimetry import camera_from_rec709
from camkit.errors import ContractError, UnsupportedError
from camkit.psf import FrozenPsf
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.raw import read_capture
from camkit.runtime.twin.exposure import Setting, sample_mosaic
from camkit.runtime.twin.simulate import (
    Simulation,
    SimulationOptions,
    simulate,
    simulate_series,
    write_capture,
)
from tests.bundle_factory import tiny_sensor
from tests.camera_factory import delta_psf, make_psf, make_sensor, whole_window
from tests.deep_bundle import deep_psf
from tests.planes_bundle import planes_sensor
from tests.psf_factory import streak_kernel, uniform_psf

SENSOR = make_sensor()
QUIET = SimulationOptions(noise=False, distort=False, vignette=False)
ONE_DN = 1 / (4095 - 256)


def scene(seed: int = 0, height: int = 64, width: int = 96) -> FloatArray:
    return np.random.default_rng(seed).random((3, height, width), dtype=np.float32) * 0.8


def signal(simulation: Simulation) -> np.ndarray:
    return (simulation.samples.astype(float) - 256) * ONE_DN


def test_perfect_camera_records_the_scene() -> None:
    picture = scene()
    found = simulate(picture, SENSOR, delta_psf(SENSOR), QUIET)
    matrix, gains = camera_from_rec709(np.array(SENSOR.color_matrix))
    planes = np.maximum(np.tensordot(matrix, picture, 1), 0).astype(np.float32)
    np.testing.assert_allclose(found.clean, planes, atol=1e-5)
    expected = sample_mosaic(planes, "RGGB", gains).clip(0, 1)
    np.testing.assert_allclose(signal(found), expected, atol=0.51 * ONE_DN)


def test_captures_of_a_series_are_those_that_are_taken_alone() -> None:
    picture, psf = scene(), make_psf(SENSOR)
    settings = [
        Setting(iso=400.0, seed=3),
        Setting(iso=100.0, seed=4, exposure=0.25, noise=False, bits=10),
    ]
    series = simulate_series(picture, SENSOR, psf, SimulationOptions(vignette=False), settings)
    for setting, found in zip(settings, series, strict=True):
        facts = {
            name: getattr(setting, name) for name in ("iso", "seed", "exposure", "noise", "bits")
        }
        alone = simulate(picture, SENSOR, psf, SimulationOptions(vignette=False, **facts))
        np.testing.assert_allclose(found.clean, alone.clean, rtol=1e-5, atol=1e-6)
        assert np.abs(found.samples.astype(int) - alone.samples).max() <= 1 - setting.noise
        assert (found.iso, found.levels) == (alone.iso, alone.levels)


def test_flat_scene_becomes_the_relative_illumination() -> None:
    psf = make_psf(SENSOR)
    flat = np.full((3, 64, 96), 0.5, dtype=np.float32)
    found = simulate(flat, SENSOR, psf, SimulationOptions(noise=False))
    _, gains = camera_from_rec709(np.array(SENSOR.color_matrix))
    light = illumination_band(psf, whole_window(SENSOR), 0, 64)
    expected = sample_mosaic(np.stack([light * 0.5] * 3), "RGGB", gains)
    np.testing.assert_allclose(signal(found), expected, atol=0.51 * ONE_DN + 2e-6)
    np.testing.assert_allclose(found.clean, 0.5, atol=1e-5)


def test_blur_keeps_the_energy_of_a_point() -> None:
    picture = np.zeros((3, 64, 96), dtype=np.float32)
    picture[:, 28:34, 60:66] = 0.9
    psf = make_psf(SENSOR)
    found = simulate(picture, SENSOR, psf, QUIET)
    green = signal(found)[0::2, 1::2].sum() + signal(found)[1::2, 0::2].sum()
    # Half of the pixels are green.
    assert green == pytest.approx(36 * 0.9 / 2, rel=0.002)


def test_crop_sees_what_the_whole_sensor_sees_there() -> None:
    sensor = make_sensor(6000, 4000)
    psf = make_psf(sensor, distortion=(1.0, 0.0, 0.0, 0.0))
    picture = scene(1, 300, 500)
    options = SimulationOptions(noise=False, origin_px=(4000, 3000))
    whole = simulate(picture, sensor, psf, options)
    part = np.ascontiguousarray(picture[:, 100:200, 200:300])
    crop = simulate(part, sensor, psf, SimulationOptions(noise=False, origin_px=(4200, 3100)))
    inside = np.s_[8:-8, 8:-8]
    # Blocks differ, so each pixel sees a slightly different mix of nearly equal PSFs.
    difference = signal(whole)[100:200, 200:300][inside] - signal(crop)[inside]
    assert np.sqrt(np.mean(difference**2)) < 0.002


def test_black_beside_light_is_photographed() -> None:
    # The blur by FFT leaves the black part some 1e-8 below zero.
    picture = np.zeros((3, 64, 96), np.float32)
    picture[:, 20:30, 20:30] = 1.0
    found = simulate(picture, SENSOR, make_psf(SENSOR), SimulationOptions(seed=1))
    assert abs(signal(found)[50:, 80:].mean()) < ONE_DN


def test_exposure_scales_the_signal() -> None:
    picture = scene() * 0.3
    one = simulate(picture, SENSOR, delta_psf(SENSOR), QUIET)
    double = simulate(
        picture,
        SENSOR,
        delta_psf(SENSOR),
        SimulationOptions(noise=False, distort=False, vignette=False, exposure=2.0),
    )
    np.testing.assert_allclose(double.clean, one.clean * 2, atol=1e-6)
    np.testing.assert_allclose(signal(double), signal(one) * 2, atol=2 * ONE_DN)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 96), (64, 1), (2, 3)])
def test_tiny_scenes_are_photographed(height: int, width: int) -> None:
    found = simulate(scene(0, height, width), SENSOR, make_psf(SENSOR), SimulationOptions())
    assert found.samples.shape == (height, width)
    assert found.clean.shape == (3, height, width)


def simulated_with(psf: FrozenPsf, picture: FloatArray, **options: object) -> Simulation:
    return simulate(picture, SENSOR, psf, SimulationOptions(**options))  # type: ignore[arg-type]


def test_scenes_that_cannot_be_are_refused() -> None:
    psf = delta_psf(SENSOR)
    with pytest.raises(ContractError, match=r"must be \(3, h, w\)"):
        simulated_with(psf, np.zeros((4, 4), np.float32))
    with pytest.raises(ContractError, match="finite"):
        simulated_with(psf, np.full((3, 4, 4), np.nan, np.float32))
    with pytest.raises(ContractError, match="finite and >= 0"):
        simulated_with(psf, np.full((3, 4, 4), -1, np.float32))
    with pytest.raises(ContractError, match="lie on the sensor"):
        simulated_with(psf, scene(0, 66, 96))
    with pytest.raises(ContractError, match="even"):
        simulated_with(psf, scene(0, 8, 8), origin_px=(3, 0))
    with pytest.raises(ContractError, match="lie on the sensor"):
        simulated_with(psf, scene(0, 8, 8), origin_px=(90, 0))


def test_impossible_options_and_sensors_are_refused() -> None:
    with pytest.raises(ContractError, match="iso"):
        SimulationOptions(iso=0)
    with pytest.raises(ContractError, match="exposure"):
        SimulationOptions(exposure=-1)
    with pytest.raises(ContractError, match="seed"):
        SimulationOptions(seed=-1)
    anywhere = planes_sensor(size_px=None)
    with pytest.raises(UnsupportedError, match="any size"):
        simulate(scene(), anywhere, uniform_psf(streak_kernel(0.0)), QUIET)


@pytest.mark.parametrize("channels", [("Y",), ("A", "B"), ("R", "G", "B"), tuple("abcde")])
def test_a_camera_of_planes_is_photographed_channel_by_channel(channels: tuple[str, ...]) -> None:
    sensor = planes_sensor(channels, full_well_e=1e6)
    kernel = streak_kernel(0.0, 2, 3)
    psf = uniform_psf(kernel, channels=len(channels))
    found = simulate(scene(3), sensor, psf, QUIET)
    assert found.samples.shape == found.clean.shape == (len(channels), 64, 96)
    assert found.white_balance == (1.0,) * len(channels)
    at_odd = SimulationOptions(origin_px=(3, 5))
    assert simulate(scene(0, 8, 8), sensor, psf, at_odd).window.origin_px == (3, 5)


def test_only_a_mosaic_is_written_as_raw(tmp_path: Path) -> None:
    sensor = planes_sensor()
    found = simulate(scene(), sensor, uniform_psf(streak_kernel(0.0)), QUIET)
    with pytest.raises(UnsupportedError, match="Bayer mosaic only"):
        write_capture(tmp_path / "a.dng", found, sensor, "planes")
    small = simulate(scene(0, 20, 40), SENSOR, delta_psf(SENSOR), QUIET)
    with pytest.raises(ContractError, match="at least 22 px"):
        write_capture(tmp_path / "a.dng", small, SENSOR, "duet")
    assert list(tmp_path.iterdir()) == []


def test_capture_is_a_real_raw_file_that_knows_its_place(tmp_path: Path) -> None:
    sensor = make_sensor(320, 240)
    options = SimulationOptions(iso=400, origin_px=(100, 60))
    found = simulate(scene(2, 120, 160), sensor, make_psf(sensor), options)
    path = tmp_path / "capture.dng"
    write_capture(path, found, sensor, "duet")
    assert [p.name for p in tmp_path.iterdir()] == ["capture.dng"]
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, found.samples)
        assert raw.white_level == 4095
    capture = read_capture(path, isolate=False)
    np.testing.assert_array_equal(capture.samples, found.samples)
    assert capture.origin_px == (100, 60)
    assert capture.sensor_size_px == (320, 240)
    assert capture.bundle_name == "duet"
    assert capture.iso == 400
    assert capture.white_balance is not None
    np.testing.assert_allclose(capture.white_balance, found.white_balance, rtol=1e-5)
    assert capture.noise is not None
    np.testing.assert_allclose(capture.noise.shot, sensor.noise_at(400).shot, rtol=1e-5)


def test_several_depths_need_one_that_is_theirs() -> None:
    sensor = tiny_sensor()
    with pytest.raises(ContractError, match=r"0\.5 m, 1 m, 2 m"):
        simulate(scene(), sensor, deep_psf(), QUIET)
    with pytest.raises(ContractError, match="got 3 m"):
        simulate(scene(), sensor, deep_psf(), SimulationOptions(depth_mm=3000.0))


def test_a_scene_is_blurred_by_the_kernel_of_its_depth() -> None:
    point = np.zeros((3, 64, 96), dtype=np.float32)
    point[:, 32, 48] = 0.5
    sensor, psf = tiny_sensor(), deep_psf()
    plain = {"noise": False, "distort": False, "vignette": False}
    peaks = {}
    for depth_mm in (500.0, 1000.0, 2000.0):
        found = simulate(point, sensor, psf, SimulationOptions(depth_mm=depth_mm, **plain))
        assert found.depth_mm == depth_mm
        peaks[depth_mm] = int(found.samples.max()) - 64
    assert peaks[500.0] < 0.7 * peaks[2000.0]
    assert peaks[2000.0] < 0.7 * peaks[1000.0]


@pytest.mark.parametrize(
    ("depths_mm", "depth_mm", "stated"),
    [((500.0, 1000.0), 700.0, 700.0), ((500.0, np.inf), np.inf, "inf"), ((500.0,), 500.0, None)],
)
def test_a_capture_states_its_depth_where_there_are_several(
    depths_mm: tuple[float, ...], depth_mm: float, stated: float | str | None, tmp_path: Path
) -> None:
    sensor = tiny_sensor()
    options = SimulationOptions(depth_mm=depth_mm)
    found = simulate(scene(), sensor, deep_psf(depths_mm), options)
    write_capture(tmp_path / "a.dng", found, sensor, "deep")
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        record = json.loads(file.pages[0].description)["camkit"]
    assert record.get("object_distance_mm") == stated
    assert read_capture(tmp_path / "a.dng").bundle_name == "deep"


@pytest.mark.parametrize("bits", [8, 14])
def test_a_capture_of_other_bits_states_its_own_levels(bits: int, tmp_path: Path) -> None:
    sensor, white = make_sensor(), 2**bits - 1
    taken = {}
    for name, options in (("usual", {}), ("other", {"bits": bits})):
        found = simulated_with(delta_psf(sensor), scene(), noise=False, **options)
        write_capture(tmp_path / f"{name}.dng", found, sensor, "duet")
        capture = read_capture(tmp_path / f"{name}.dng", isolate=False)
        taken[name] = capture
    assert taken["other"].white_level == white
    assert taken["other"].samples.max() <= white
    signals = [
        (c.samples - c.black_level[0, 0]) / (c.white_level - c.black_level[0, 0])
        for c in taken.values()
    ]
    # a black level of whole DN moves the signal by half a step at most
    np.testing.assert_allclose(signals[0], signals[1], atol=1.1 / min(white, 4095))

import json
from pathlib import Path

import numpy as np
import pytest
import rawpy
import tifffile

from camkit.colorimetry import camera_from_rec709
from camkit.contracts import FloatArray, FrozenPsf
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.geometry.warp import Warp
from camkit.runtime.raw import read_capture
from camkit.runtime.twin.simulate import (
    Simulation,
    SimulationOptions,
    expose,
    sample_mosaic,
    simulate,
    write_capture,
)
from tests.bundle_factory import tiny_camera
from tests.camera_factory import delta_psf, make_camera, make_psf, whole_window
from tests.deep_bundle import deep_psf

CAMERA = make_camera()
QUIET = SimulationOptions(noise=False, distort=False, vignette=False)
ONE_DN = 1 / (4095 - 256)


def scene(seed: int = 0, height: int = 64, width: int = 96) -> FloatArray:
    return np.random.default_rng(seed).random((3, height, width), dtype=np.float32) * 0.8


def signal(simulation: Simulation) -> np.ndarray:
    return (simulation.mosaic.astype(float) - 256) * ONE_DN


def test_perfect_camera_records_the_scene() -> None:
    picture = scene()
    found = simulate(picture, CAMERA, delta_psf(CAMERA), QUIET)
    matrix, gains = camera_from_rec709(np.array(CAMERA.color_matrix))
    planes = np.maximum(np.tensordot(matrix, picture, 1), 0).astype(np.float32)
    np.testing.assert_allclose(found.clean, planes, atol=1e-5)
    expected = sample_mosaic(planes, "RGGB", gains).clip(0, 1)
    np.testing.assert_allclose(signal(found), expected, atol=0.51 * ONE_DN)


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_every_pixel_sees_the_colour_of_its_filter(cfa: str) -> None:
    planes = np.stack([np.full((5, 7), v, np.float32) for v in (0.2, 0.4, 0.8)])
    mosaic = sample_mosaic(planes, cfa, (2.0, 1.0, 4.0))  # type: ignore[arg-type]
    values = {"R": 0.1, "G": 0.4, "B": 0.2}
    for row in range(5):
        for column in range(7):
            letter = cfa[2 * (row % 2) + column % 2]
            assert mosaic[row, column] == pytest.approx(values[letter])


def test_flat_scene_becomes_the_relative_illumination() -> None:
    psf = make_psf(CAMERA)
    flat = np.full((3, 64, 96), 0.5, dtype=np.float32)
    found = simulate(flat, CAMERA, psf, SimulationOptions(noise=False))
    _, gains = camera_from_rec709(np.array(CAMERA.color_matrix))
    light = illumination_band(psf, whole_window(CAMERA), 0, 64)
    expected = sample_mosaic(np.stack([light * 0.5] * 3), "RGGB", gains)
    np.testing.assert_allclose(signal(found), expected, atol=0.51 * ONE_DN + 2e-6)
    np.testing.assert_allclose(found.clean, 0.5, atol=1e-5)


def test_blur_keeps_the_energy_of_a_point() -> None:
    picture = np.zeros((3, 64, 96), dtype=np.float32)
    picture[:, 28:34, 60:66] = 0.9
    psf = make_psf(CAMERA)
    found = simulate(picture, CAMERA, psf, QUIET)
    green = signal(found)[0::2, 1::2].sum() + signal(found)[1::2, 0::2].sum()
    # Half of the pixels are green.
    assert green == pytest.approx(36 * 0.9 / 2, rel=0.002)


def test_point_lands_where_the_distortion_says() -> None:
    camera = make_camera(256, 192)
    psf = make_psf(camera, distortion=(1.0, -0.06, 0.0, 0.0))
    picture = np.zeros((3, 192, 256), dtype=np.float32)
    y, x = np.mgrid[0:192, 0:256].astype(np.float32)
    picture[:] = np.exp(-((x - 220) ** 2 + (y - 30) ** 2) / 18)
    clean = simulate(picture, camera, psf, SimulationOptions(noise=False)).clean[1]
    rows, columns = np.mgrid[0:192, 0:256]
    found = np.array([(clean * columns).sum(), (clean * rows).sum()]) / clean.sum()
    warp = Warp(psf.distortion, whole_window(camera), to_sensor=False)
    expected = warp.positions(1, np.array(220.0), np.array(30.0))
    np.testing.assert_allclose(found, expected, atol=0.05)
    assert np.hypot(*(found - [220, 30])) > 3


def test_crop_sees_what_the_whole_sensor_sees_there() -> None:
    camera = make_camera(6000, 4000)
    psf = make_psf(camera, distortion=(1.0, 0.0, 0.0, 0.0))
    picture = scene(1, 300, 500)
    options = SimulationOptions(noise=False, origin_px=(4000, 3000))
    whole = simulate(picture, camera, psf, options)
    part = np.ascontiguousarray(picture[:, 100:200, 200:300])
    crop = simulate(part, camera, psf, SimulationOptions(noise=False, origin_px=(4200, 3100)))
    inside = np.s_[8:-8, 8:-8]
    # Blocks differ, so each pixel sees a slightly different mix of nearly equal PSFs.
    difference = signal(whole)[100:200, 200:300][inside] - signal(crop)[inside]
    assert np.sqrt(np.mean(difference**2)) < 0.002


def flat_noise(level: float, iso: float) -> np.ndarray:
    rng_signal = np.full((400, 500), level, dtype=np.float32)
    dn = expose(rng_signal, CAMERA, SimulationOptions(iso=iso, seed=3))
    return (dn.astype(float) - 256) * ONE_DN


# At ISO 100 the read noise is a quarter of a DN, and rounding does not add as noise there.
@pytest.mark.parametrize(
    ("iso", "level"), [(100, 0.01), (100, 0.3), (400, 0.0), (400, 0.3), (3200, 0.0), (3200, 0.3)]
)
def test_noise_has_the_mean_and_variance_of_the_model(iso: float, level: float) -> None:
    found = flat_noise(level, iso)
    noise = CAMERA.noise_at(iso)
    variance = noise.shot[0] * level + noise.read_variance[0] + ONE_DN**2 / 12
    assert found.mean() == pytest.approx(level, abs=5 * np.sqrt(variance / found.size))
    assert found.var() == pytest.approx(variance, rel=0.02)


def test_same_seed_gives_the_same_noise_and_another_does_not() -> None:
    level = np.full((20, 20), 0.2, dtype=np.float32)
    one, again, other = (expose(level, CAMERA, SimulationOptions(seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.5


def test_black_beside_light_is_photographed() -> None:
    # The blur by FFT leaves the black part some 1e-8 below zero.
    picture = np.zeros((3, 64, 96), np.float32)
    picture[:, 20:30, 20:30] = 1.0
    found = simulate(picture, CAMERA, make_psf(CAMERA), SimulationOptions(seed=1))
    assert abs(signal(found)[50:, 80:].mean()) < ONE_DN


def test_light_beyond_white_saturates() -> None:
    bright = np.full((20, 20), 3.0, dtype=np.float32)
    assert (expose(bright, CAMERA, SimulationOptions(iso=800)) == 4095).all()


def test_small_full_well_saturates_below_white() -> None:
    shallow = make_camera(full_well_e=20000.0)
    bright = np.full((20, 20), 3.0, dtype=np.float32)
    dn = expose(bright, shallow, SimulationOptions(noise=False))
    np.testing.assert_array_equal(dn, round(256 + 20000 / 11.72))


def test_read_noise_below_black_is_kept() -> None:
    dark = expose(np.zeros((50, 50), np.float32), CAMERA, SimulationOptions(iso=6400))
    assert dark.min() < 256 < dark.max()


def test_exposure_scales_the_signal() -> None:
    picture = scene() * 0.3
    one = simulate(picture, CAMERA, delta_psf(CAMERA), QUIET)
    double = simulate(
        picture,
        CAMERA,
        delta_psf(CAMERA),
        SimulationOptions(noise=False, distort=False, vignette=False, exposure=2.0),
    )
    np.testing.assert_allclose(double.clean, one.clean * 2, atol=1e-6)
    np.testing.assert_allclose(signal(double), signal(one) * 2, atol=2 * ONE_DN)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 96), (64, 1), (2, 3)])
def test_tiny_scenes_are_photographed(height: int, width: int) -> None:
    found = simulate(scene(0, height, width), CAMERA, make_psf(CAMERA), SimulationOptions())
    assert found.mosaic.shape == (height, width)
    assert found.clean.shape == (3, height, width)


def simulated_with(psf: FrozenPsf, picture: FloatArray, **options: object) -> Simulation:
    return simulate(picture, CAMERA, psf, SimulationOptions(**options))  # type: ignore[arg-type]


def test_scenes_that_cannot_be_are_refused() -> None:
    psf = delta_psf(CAMERA)
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


def test_impossible_options_and_cameras_are_refused() -> None:
    with pytest.raises(ContractError, match="iso"):
        SimulationOptions(iso=0)
    with pytest.raises(ContractError, match="exposure"):
        SimulationOptions(exposure=-1)
    grey = make_camera(cfa=None)
    with pytest.raises(UnsupportedError, match="Bayer"):
        simulate(scene(), grey, delta_psf(grey), QUIET)


def test_capture_is_a_real_raw_file_that_knows_its_place(tmp_path: Path) -> None:
    camera = make_camera(320, 240)
    options = SimulationOptions(iso=400, origin_px=(100, 60))
    found = simulate(scene(2, 120, 160), camera, make_psf(camera), options)
    path = tmp_path / "capture.dng"
    write_capture(path, found, camera, "duet")
    assert [p.name for p in tmp_path.iterdir()] == ["capture.dng"]
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, found.mosaic)
        assert raw.white_level == 4095
    capture = read_capture(path, isolate=False)
    np.testing.assert_array_equal(capture.samples, found.mosaic)
    assert capture.origin_px == (100, 60)
    assert capture.sensor_size_px == (320, 240)
    assert capture.bundle_name == "duet"
    assert capture.iso == 400
    assert capture.white_balance is not None
    np.testing.assert_allclose(capture.white_balance, found.white_balance, rtol=1e-5)
    assert capture.noise is not None
    np.testing.assert_allclose(capture.noise.shot, camera.noise_at(400).shot, rtol=1e-5)


def test_a_scene_is_blurred_by_the_kernel_of_its_depth() -> None:
    point = np.zeros((3, 64, 96), dtype=np.float32)
    point[:, 32, 48] = 0.5
    camera, psf = tiny_camera(), deep_psf()
    plain = {"noise": False, "distort": False, "vignette": False}
    peaks = {}
    for depth_mm in (500.0, 1000.0, 2000.0):
        found = simulate(point, camera, psf, SimulationOptions(depth_mm=depth_mm, **plain))
        assert found.depth_mm == depth_mm
        peaks[depth_mm] = int(found.mosaic.max()) - 64
    assert peaks[500.0] < 0.7 * peaks[2000.0]
    assert peaks[2000.0] < 0.7 * peaks[1000.0]


def test_several_depths_need_one_that_is_theirs() -> None:
    camera = tiny_camera()
    with pytest.raises(ContractError, match=r"0\.5 m, 1 m, 2 m"):
        simulate(scene(), camera, deep_psf(), QUIET)
    with pytest.raises(ContractError, match="got 3 m"):
        simulate(scene(), camera, deep_psf(), SimulationOptions(depth_mm=3000.0))


@pytest.mark.parametrize(
    ("depths_mm", "depth_mm", "stated"),
    [((500.0, 1000.0), 700.0, 700.0), ((500.0, np.inf), np.inf, "inf"), ((500.0,), 500.0, None)],
)
def test_a_capture_states_its_depth_where_there_are_several(
    depths_mm: tuple[float, ...], depth_mm: float, stated: float | str | None, tmp_path: Path
) -> None:
    camera = tiny_camera()
    options = SimulationOptions(depth_mm=depth_mm)
    found = simulate(scene(), camera, deep_psf(depths_mm), options)
    write_capture(tmp_path / "a.dng", found, camera, "deep")
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        record = json.loads(file.pages[0].description)["camkit"]
    assert record.get("object_distance_mm") == stated
    assert read_capture(tmp_path / "a.dng").bundle_name == "deep"

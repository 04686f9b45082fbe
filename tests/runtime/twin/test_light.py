"""Light goes where the optics send it: as direct convolution says, at its place on the sensor."""

from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.sensor import Extent, PlanesSensor
from camkit.colorimetry import camera_from_rec709
from camkit.errors import ContractError
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import Warp
from camkit.runtime.twin.light import (
    LUMINANCE,
    Light,
    LightOptions,
    camera_space,
    crop_light,
    lens_of,
    light_of,
    scene_window,
    with_axis_moved,
    with_kernels,
)
from tests.camera_factory import delta_psf, make_psf, make_sensor, whole_window
from tests.deep_bundle import deep_psf
from tests.planes_bundle import planes_sensor
from tests.psf_factory import PITCH_UM, grid_psf, streak_kernel, uniform_psf

FFT_ERROR = 2e-6
BARE = LightOptions(distort=False, vignette=False)


def _planes_camera(
    size: int = 64, channels: tuple[str, ...] = ("Y",), **extent: object
) -> PlanesSensor:
    """Give a camera of planes at the pitch of the PSFs of `tests.psf_factory`."""
    place = {"width_px": size, "height_px": size, "pixel_pitch_um": PITCH_UM} | extent
    return planes_sensor(channels, extent=Extent(**place))  # type: ignore[arg-type]


def _points(size: int, *places: tuple[int, int]) -> FloatArray:
    scene = np.zeros((3, size, size), np.float32)
    for row, column in places:
        scene[:, row, column] = 1
    return scene


def _light(
    scene: FloatArray, sensor: PlanesSensor, psf: FrozenPsf, options: LightOptions = BARE
) -> Light:
    return light_of(scene, sensor, lens_of(psf, sensor), scene_window(scene, sensor, None), options)


def _patch(light: Light, row: int, column: int, half: int = 10, channel: int = 0) -> FloatArray:
    at = np.s_[channel, row - half : row + half + 1, column - half : column + half + 1]
    return light.planes[at]


# --------------------------------------------------------------------------- where light lands


@pytest.mark.parametrize("turn_deg", [0.0, 37.0, 90.0, 200.0])
@pytest.mark.parametrize("channels", [("Y",), ("A", "B", "C", "D")])
def test_a_streak_lands_where_it_was_measured_in_every_quadrant(
    turn_deg: float, channels: tuple[str, ...]
) -> None:
    """A uniform PSF is neither made symmetric, nor turned, nor mirrored."""
    kernel = streak_kernel(turn_deg)
    sensor = _planes_camera(96, channels)
    places = [(24, 24), (24, 71), (71, 24), (71, 71)]
    light = _light(_points(96, *places), sensor, uniform_psf(kernel, channels=len(channels)))
    for row, column in places:
        for channel in range(len(channels)):
            found = _patch(light, row, column, channel=channel)
            np.testing.assert_allclose(found, kernel, atol=FFT_ERROR)


def test_a_rectangular_kernel_lands_about_its_own_centre() -> None:
    wide = np.zeros((5, 13), np.float32)
    wide[2, 6:] = np.arange(7, 0, -1)
    wide[0, 6] = 3
    wide /= wide.sum()
    sensor = _planes_camera()
    light = _light(_points(64, (20, 40)), sensor, uniform_psf(wide))
    np.testing.assert_allclose(light.planes[0, 18:23, 34:47], wide, atol=FFT_ERROR)
    assert light.planes[0].sum() == pytest.approx(1, abs=1e-4)
    tall = uniform_psf(np.ascontiguousarray(wide.T))
    turned = _light(_points(64, (20, 40)), sensor, tall)
    np.testing.assert_allclose(turned.planes[0, 14:27, 38:43], wide.T, atol=FFT_ERROR)


def _corner_psf() -> tuple[FrozenPsf, np.ndarray]:
    """Give a grid of four streaks in four directions, and these."""
    streaks = np.stack([streak_kernel(turn) for turn in (10.0, 130.0, 200.0, 310.0)])
    at_mm = np.array([-0.3, 0.3])  # nearer to the axis than the middles of blocks of light
    return grid_psf(streaks.reshape(2, 2, 21, 21), at_mm, at_mm), streaks


def test_streaks_on_a_grid_land_as_those_of_their_places() -> None:
    psf, streaks = _corner_psf()
    sensor = _planes_camera(256)
    places = [(30, 30), (30, 225), (225, 30), (225, 225)]
    light = _light(_points(256, *places), sensor, psf)
    for streak, (row, column) in zip(streaks, places, strict=True):
        np.testing.assert_allclose(_patch(light, row, column), streak, atol=FFT_ERROR)


def test_the_optical_centre_moves_the_grid_on_the_sensor() -> None:
    """Kernels belong to places from the axis, wherever that meets the sensor."""
    psf, streaks = _corner_psf()
    scene = _points(256, (30, 30), (225, 225))
    far_left = _planes_camera(256, optical_centre_px=(-300.0, -300.0))
    light = _light(scene, far_left, psf)
    for row, column in ((30, 30), (225, 225)):  # all of it lies right of and below the axis
        np.testing.assert_allclose(_patch(light, row, column), streaks[3], atol=FFT_ERROR)
    lens = with_axis_moved(lens_of(psf, _planes_camera(256)), -4.0, 4.0)
    window = scene_window(scene, _planes_camera(256), None)
    moved = light_of(scene, _planes_camera(256), lens, window, BARE)
    np.testing.assert_allclose(_patch(moved, 30, 30), streaks[1], atol=FFT_ERROR)


def test_point_lands_where_the_distortion_says() -> None:
    sensor = make_sensor(256, 192)
    psf = make_psf(sensor, distortion=(1.0, -0.06, 0.0, 0.0))
    picture = np.zeros((3, 192, 256), dtype=np.float32)
    y, x = np.mgrid[0:192, 0:256].astype(np.float32)
    picture[:] = np.exp(-((x - 220) ** 2 + (y - 30) ** 2) / 18)
    window = scene_window(picture, sensor, None)
    clean = light_of(picture, sensor, lens_of(psf, sensor), window).clean[1]
    rows, columns = np.mgrid[0:192, 0:256]
    found = np.array([(clean * columns).sum(), (clean * rows).sum()]) / clean.sum()
    warp = Warp(psf.distortion, whole_window(sensor), to_sensor=False)
    expected = warp.positions(1, np.array(220.0), np.array(30.0))
    np.testing.assert_allclose(found, expected, atol=0.05)
    assert np.hypot(*(found - [220, 30])) > 3


def test_distortion_goes_out_from_the_optical_centre() -> None:
    """What lies on the axis stays; the same distance right and left of it moves alike."""
    barrel = RadialDistortion(coefficients=np.array([[1.0, -0.05, 0.0, 0.0]]), radius_mm=0.6)
    delta = np.zeros((3, 3), np.float32)
    delta[1, 1] = 1
    psf = replace(uniform_psf(delta), distortion=barrel)
    y, x = np.mgrid[0:96, 0:96].astype(np.float32)
    axis = (40.0, 47.5)
    moved = {}
    for offset in (-30, 0, 30):
        spot = np.exp(-((x - axis[0] - offset) ** 2 + (y - axis[1]) ** 2) / 8)
        sensor = _planes_camera(96, optical_centre_px=axis)
        scene = np.stack([spot] * 3)
        clean = light_of(
            scene, sensor, lens_of(psf, sensor), scene_window(scene, sensor, None)
        ).clean[0]
        moved[offset] = float((clean * x).sum() / clean.sum()) - axis[0] - offset
    # pictures are centred on the middle of the window, which the axis is beside here
    shift = moved[0]
    assert abs(shift) < 0.05
    assert moved[30] - shift < -0.3
    assert moved[30] - shift == pytest.approx(-(moved[-30] - shift), abs=0.03)


def test_without_an_optical_centre_light_has_the_bits_of_one_in_the_middle() -> None:
    psf, _ = _corner_psf()
    scene = np.random.default_rng(0).random((3, 96, 96), dtype=np.float32)
    plain, stated = (
        _light(scene, _planes_camera(96, **given), psf, LightOptions())
        for given in ({}, {"optical_centre_px": (47.5, 47.5)})
    )
    np.testing.assert_array_equal(plain.planes, stated.planes)
    np.testing.assert_array_equal(plain.clean, stated.clean)


def _wide_kernel(half: int = 200) -> FloatArray:
    """Give a kernel of a plate's size: a core, four lines at odd angles, one of them one-sided."""
    at = np.arange(-half, half + 1)
    y, x = np.meshgrid(at, at, indexing="ij")
    kernel = 0.9 * np.exp(-(x**2 + y**2) / 2.0) + 1e-6
    for turn_deg, both in ((12.0, True), (57.0, True), (103.0, True), (150.0, False)):
        turn = np.deg2rad(turn_deg)
        along = x * np.cos(turn) + y * np.sin(turn)
        line = np.exp(-((y * np.cos(turn) - x * np.sin(turn)) ** 2)) * (np.abs(along) > 8)
        kernel += 2e-3 * line * np.exp(-np.abs(along) / 120) * (both | (along > 0))
    return (kernel / kernel.sum()).astype(np.float32)


def _slow_light(around: FloatArray, kernel: FloatArray, size: tuple[int, int]) -> np.ndarray:
    """Add the kernel of every lamp, one by one, to a picture in the middle of what is around it."""
    half = kernel.shape[0] // 2
    height, width = size
    top, left = (around.shape[0] - height) // 2, (around.shape[1] - width) // 2
    found = np.zeros(size)
    for row, column in zip(*np.nonzero(around), strict=True):
        rows = np.arange(height) + top - row + half
        columns = np.arange(width) + left - column + half
        seen = np.ix_((rows >= 0) & (rows <= 2 * half), (columns >= 0) & (columns <= 2 * half))
        inside = kernel[np.ix_(rows[seen[0][:, 0]], columns[seen[1][0]])]
        found[seen] += float(around[row, column]) * inside
    return found


def _lamps(height: int, width: int, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    lamps = np.zeros((height, width), np.float32)
    places = rng.integers(0, height, 9), rng.integers(0, width, 9)
    lamps[places] = np.exp2(rng.uniform(0, 8, 9))
    return lamps


@pytest.mark.parametrize("surround_px", [0, 60, 200, 230])
@pytest.mark.parametrize("distort", [False, True])
def test_a_kernel_wider_than_the_picture_is_the_sum_over_all_lamps(
    surround_px: int, *, distort: bool
) -> None:
    """Lamps of the surround throw light into the frame; beyond it the scene is mirrored."""
    size, kernel = (40, 56), _wide_kernel()
    height, width = (side + 2 * surround_px for side in size)
    lamps = _lamps(height, width)
    beyond = max(200 - surround_px, 0)
    around = np.pad(lamps, beyond, mode="reflect")
    sensor = _planes_camera(64)
    scene = np.stack([lamps] * 3)
    window = scene_window(scene, sensor, None, surround_px=surround_px)
    options = LightOptions(distort=distort, vignette=False, surround_px=surround_px)
    psf = uniform_psf(kernel)
    light = light_of(scene, sensor, lens_of(psf, sensor), window, options)
    assert light.planes.shape == (1, *size)
    expected = _slow_light(around, kernel, size)
    np.testing.assert_allclose(light.planes[0], expected, atol=4 * FFT_ERROR * around.max())
    inner = lamps[surround_px : height - surround_px, surround_px : width - surround_px]
    np.testing.assert_allclose(light.clean[0], inner, atol=1e-4)


def test_a_lamp_outside_the_frame_lights_it_and_is_not_seen() -> None:
    sensor = _planes_camera(64)
    psf = uniform_psf(_wide_kernel())
    scene = np.zeros((3, 164, 164), np.float32)
    scene[:, 82, 20] = 100
    window = scene_window(scene, sensor, None, surround_px=50)
    options = LightOptions(distort=False, vignette=False, surround_px=50)
    light = light_of(scene, sensor, lens_of(psf, sensor), window, options)
    assert light.clean.max() == 0
    assert light.planes[0, :, 0].max() > 0.01
    alone = light_of(scene[:, 50:-50, 50:-50], sensor, lens_of(psf, sensor), window, BARE)
    assert alone.planes.max() < 1e-6


def test_the_surround_of_a_finer_scene_is_as_fine_as_it() -> None:
    """In pixels it is as wide, and the truth ends at the frame."""
    sensor, psf = _planes_camera(64), uniform_psf(streak_kernel(30.0))
    coarse = np.random.default_rng(1).random((3, 80, 84), dtype=np.float32)
    fine = coarse.repeat(2, axis=1).repeat(2, axis=2)
    lights = []
    for scene, scale in ((coarse, 1), (fine, 2)):
        window = scene_window(scene, sensor, None, scale=scale, surround_px=12)
        options = LightOptions(scale=scale, surround_px=12, vignette=False)
        lights.append(light_of(scene, sensor, lens_of(psf, sensor), window, options))
    np.testing.assert_allclose(lights[1].planes, lights[0].planes, atol=FFT_ERROR)
    assert lights[1].clean.shape == (1, 112, 120)
    np.testing.assert_allclose(
        lights[1].clean, lights[0].clean.repeat(2, axis=1).repeat(2, axis=2), atol=1e-3
    )


@pytest.mark.parametrize("surround_px", [-1, 32, 500])
def test_a_surround_that_leaves_no_picture_is_refused(surround_px: int) -> None:
    scene = np.zeros((3, 64, 64), np.float32)
    with pytest.raises(ContractError, match="surround must be >= 0 px and leave a picture"):
        scene_window(scene, _planes_camera(64), None, surround_px=surround_px)


# --------------------------------------------------------------------------- lens and colour


def test_changed_kernels_are_cut_at_zero_and_normalised() -> None:
    sensor = _planes_camera()
    lens = with_kernels(lens_of(uniform_psf(streak_kernel(0.0)), sensor), lambda k: k - k.mean())
    kernel = lens.kernels_at(0.0, 0.0)
    assert kernel.min() == 0
    np.testing.assert_allclose(kernel.sum(axis=(-2, -1)), 1, atol=1e-6)


def test_light_comes_from_one_depth() -> None:
    sensor = make_sensor()
    with pytest.raises(ContractError, match=r"those the PSF knows, 0\.5 m, 1 m, 2 m"):
        lens_of(deep_psf(), sensor)
    near, far = (
        lens_of(deep_psf(), sensor, depth_mm=depth_mm).kernels_at(0.0, 0.0)
        for depth_mm in (500.0, 1000.0)
    )
    assert near.max() < 0.7 * far.max()


def test_colour_is_that_of_the_matrix_else_rec709_else_its_luminance() -> None:
    bayer = make_sensor()
    matrix, gains = camera_space(bayer)
    expected = camera_from_rec709(np.array(bayer.color_matrix))
    np.testing.assert_array_equal(matrix, expected[0])
    assert gains == expected[1]
    np.testing.assert_array_equal(camera_space(planes_sensor(("R", "G", "B")))[0], np.eye(3))
    for count in (1, 2, 5):
        matrix, gains = camera_space(planes_sensor(tuple("abcde")[:count]))
        np.testing.assert_array_equal(matrix, np.tile(LUMINANCE, (count, 1)))
        assert gains == (1.0,) * count


def test_a_perfect_lens_gives_the_scene_in_the_channels_of_the_sensor() -> None:
    delta = np.zeros((3, 3), np.float32)
    delta[1, 1] = 1
    scene = np.random.default_rng(0).random((3, 64, 64), dtype=np.float32)
    light = _light(scene, _planes_camera(), uniform_psf(delta))
    grey = np.tensordot(np.array(LUMINANCE), scene, axes=1)
    np.testing.assert_allclose(light.planes[0], grey, atol=FFT_ERROR)
    np.testing.assert_allclose(light.clean[0], grey, atol=FFT_ERROR)


def test_a_crop_of_light_is_a_smaller_capture_at_the_same_place() -> None:
    sensor = make_sensor()
    scene = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    light = light_of(
        scene, sensor, lens_of(make_psf(sensor), sensor), scene_window(scene, sensor, None)
    )
    crop = crop_light(light, (40, 24))
    np.testing.assert_array_equal(crop.planes, light.planes[:, :24, :40])
    assert crop.window == replace(light.window, size_px=(40, 24))
    crop.planes[:] = 0
    assert light.planes.any()


def test_only_asked_for_effects_are_applied() -> None:
    sensor = make_sensor()
    scene = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    window, lens = scene_window(scene, sensor, None), lens_of(delta_psf(sensor), sensor)
    bare = light_of(scene, sensor, lens, window, BARE)
    assert bare.vignetting is None
    assert light_of(scene, sensor, lens, window).vignetting is lens.psf
    twice = light_of(scene, sensor, lens, window, replace(BARE, exposure=2.0))
    np.testing.assert_allclose(twice.planes, 2 * bare.planes, atol=1e-5)
    warm = replace(lens, gains=(3.0, 1.0, 2.0))
    assert light_of(scene, sensor, warm, window, BARE).gains == (3.0, 1.0, 2.0)


def test_a_scene_lies_on_the_sensor_by_its_origin_and_its_axis() -> None:
    sensor = _planes_camera(96, optical_centre_px=(40.0, 50.0))
    scene = np.zeros((3, 32, 48), np.float32)
    assert scene_window(scene, sensor, (7, 9)) == SensorWindow(
        size_px=(48, 32),
        origin_px=(7, 9),
        sensor_size_px=(96, 96),
        pitch_um=PITCH_UM,
        axis_px=(40.0, 50.0),
    )
    assert scene_window(scene, make_sensor(), None).origin_px == (24, 16)
    assert scene_window(scene[:, :31, :47], _planes_camera(96), None).origin_px == (24, 32)

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.arrays import FloatArray
from camkit.bundle.stages.undistort import Interpolation
from camkit.errors import ContractError, UnsupportedError
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.resampling import FLOOR
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.geometry.warp import Warp, distort_array, undistort_bands
from camkit.runtime.rows import ArrayRows, RollingRows

SENSOR = (1536, 1024)
PITCH_UM = 20.0
RADIUS_MM = float(np.hypot(*SENSOR)) / 2 * PITCH_UM / 1000
THERE_AND_BACK_DB = 45.0
MAP_ERROR_PX = 0.02


def distortion(*rows: tuple[float, ...]) -> RadialDistortion:
    filled = np.array(rows * 3 if len(rows) == 1 else rows, dtype=float)
    return RadialDistortion(coefficients=filled, radius_mm=RADIUS_MM)


BARREL = distortion((1.0, -0.05, -0.008, 0.001))
IDENTITY = distortion((1.0, 0.0, 0.0, 0.0))


def window(size: tuple[int, int] = SENSOR, origin: tuple[float, float] = (0, 0)) -> SensorWindow:
    return SensorWindow(size_px=size, origin_px=origin, sensor_size_px=SENSOR, pitch_um=PITCH_UM)


def undistort(
    picture: FloatArray, model: RadialDistortion, place: SensorWindow, band_rows: int = 256
) -> FloatArray:
    bands = undistort_bands(ArrayRows(picture), model, place, band_rows=band_rows)
    return np.concatenate(list(bands), axis=1)


def band_limited(height: int, width: int, cycles_per_px: float) -> FloatArray:
    spectrum = np.fft.rfft2(np.random.default_rng(3).standard_normal((height, width)))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    spectrum[frequency > cycles_per_px] = 0
    picture = np.fft.irfft2(spectrum, (height, width))
    picture = (picture - picture.min()) / np.ptp(picture)
    return np.tile(picture.astype(np.float32), (3, 1, 1))


def psnr(found: FloatArray, truth: FloatArray) -> float:
    return float(-10 * np.log10(np.mean((found - truth) ** 2)))


def test_cubic_interpolation_is_near_lanczos_and_does_not_depend_on_bands() -> None:
    place, picture = window((640, 424), (512, 340)), band_limited(424, 640, 0.1)

    def cubic(band_rows: int) -> FloatArray:
        bands = undistort_bands(
            ArrayRows(picture), BARREL, place, band_rows=band_rows, interpolation="cubic"
        )
        return np.concatenate(list(bands), axis=1)

    made = cubic(256)
    np.testing.assert_array_equal(made, cubic(64))
    plain = undistort(picture, BARREL, place)
    assert 40 < psnr(made, plain) < 80


@pytest.mark.parametrize("origin", [(0, 0), (512, 340), (896, 600)])
def test_band_limited_picture_survives_there_and_back(origin: tuple[int, int]) -> None:
    size = SENSOR if origin == (0, 0) else (640, 424)
    place, picture = window(size, origin), band_limited(size[1], size[0], 0.1)
    back = undistort(distort_array(picture, BARREL, place), BARREL, place)
    inside = np.s_[:, 64:-64, 64:-64]
    assert psnr(back[inside], picture[inside]) >= THERE_AND_BACK_DB


def test_cosine_at_a_tenth_cycle_survives_there_and_back() -> None:
    place = window()
    x = np.arange(SENSOR[0], dtype=np.float32)
    row = 0.5 + 0.5 * np.cos(2 * np.pi * 0.1 * x)
    picture = np.ascontiguousarray(np.broadcast_to(row, (3, SENSOR[1], SENSOR[0])), np.float32)
    back = undistort(distort_array(picture, BARREL, place), BARREL, place)
    inside = np.s_[:, 64:-64, 64:-64]
    assert psnr(back[inside], picture[inside]) >= THERE_AND_BACK_DB


def test_identity_returns_the_same_pixels() -> None:
    picture = band_limited(96, 128, 0.4)
    place = window((128, 96), (600, 400))
    np.testing.assert_array_equal(undistort(picture, IDENTITY, place, 32), picture)
    np.testing.assert_array_equal(distort_array(picture, IDENTITY, place), picture)


@settings(deadline=None, max_examples=15)
@given(
    height=st.integers(1, 120),
    width=st.integers(1, 120),
    band_rows=st.sampled_from([16, 32, 48, 112]),
    x=st.integers(0, 1400),
    y=st.integers(0, 900),
)
def test_pixels_do_not_depend_on_the_bands(
    height: int, width: int, band_rows: int, x: int, y: int
) -> None:
    picture = np.random.default_rng(4).random((3, height, width), dtype=np.float32)
    place = window((width, height), (x, y))
    model = distortion((1.0, -0.05, 0, 0), (1.0, -0.05, 0, 0), (1.002, -0.045, 0, 0))
    whole = undistort(picture, model, place, 128)
    assert whole.shape == picture.shape
    np.testing.assert_array_equal(undistort(picture, model, place, band_rows), whole)


@pytest.mark.parametrize("interpolation", ["cubic", "lanczos"])
def test_rims_beyond_the_border_do_not_depend_on_the_bands(interpolation: Interpolation) -> None:
    """Magnified: bands of 8 rows at both ends come from beyond the picture alone."""
    model, place = distortion((1.0937, 0, 0, 0)), window((16, 640), (700, 200))
    picture = np.random.default_rng(6).uniform(1.1, 1.9, (3, 640, 16)).astype(np.float32)
    picture[:, 1:-1] -= 1

    def limited(band_rows: int) -> FloatArray:
        bands = undistort_bands(
            ArrayRows(picture),
            model,
            place,
            band_rows=band_rows,
            interpolation=interpolation,
            overshoot="limited",
        )
        return np.concatenate(list(bands), axis=1)

    np.testing.assert_allclose(limited(8), limited(640), atol=1e-6)


def test_map_follows_the_model_between_its_nodes() -> None:
    warp = Warp(BARREL, window(), to_sensor=False)
    whole, fraction = warp.maps(1, 512, 576)
    assert isinstance(fraction, np.ndarray)
    found = whole + np.stack([fraction & 31, fraction >> 5], axis=-1) / 32
    y, x = np.mgrid[512:576, 0 : SENSOR[0]].astype(float)
    assert np.abs(found - warp.positions(1, x, y)).max() < MAP_ERROR_PX


@given(x=st.integers(0, SENSOR[0] - 1), y=st.integers(0, SENSOR[1] - 1), top=st.integers(0, 120))
@settings(max_examples=60, deadline=None)
def test_places_in_fixed_point_are_sums_of_whole_numbers(x: int, y: int, top: int) -> None:
    warp = Warp(BARREL, window(), to_sensor=False, places="fixed")
    first = min(top * 8, y // 8 * 8)
    whole, fraction = warp.maps(1, first, min(first + 256, SENSOR[1]))
    if not first <= y < first + 256:
        return

    def shares(at: int) -> dict[int, int]:
        """Return nodes around a pixel with their shares in sixteenths."""
        cell, odd = at // 8, 2 * (at % 8) - 7
        return {cell: 16 - abs(odd), cell + (1 if odd > 0 else -1): abs(odd)}

    total = np.zeros(2, dtype=object)
    for row, down in shares(y).items():
        for column, across in shares(x).items():
            node = warp.positions(1, np.array(8 * column + 3.5), np.array(8 * row + 3.5))
            total += np.array([int(np.floor(v * 256 + 0.5)) for v in node], object) * down * across
    expected = [(int(part) * 64 + 256 * 256) // (2 * 256 * 256) for part in total]
    steps = int(np.asarray(fraction)[y - first, x])
    found = whole[y - first, x].astype(int) * 32 + [steps % 32, steps // 32]
    assert found.tolist() == expected


def test_places_beyond_16_bits_end_there_in_both_arithmetics() -> None:
    """A long picture whose corners reach far outside of it."""
    size = (32760, 64)
    model = distortion(*[(1.01, 0, 0, 0)] * 3)
    place = SensorWindow(size_px=size, origin_px=(0, 0), sensor_size_px=size, pitch_um=0.1)
    rows = [
        Warp(model, place, to_sensor=False, places=places).maps(1, 0, 64)[0].astype(int)
        for places in ("float", "fixed")
    ]
    assert rows[0].max() == rows[1].max() == 32767
    assert np.abs(rows[0] - rows[1]).max() <= 1


def test_source_rows_are_read_downwards_and_forgotten() -> None:
    picture = band_limited(512, 384, 0.2)
    place = window((384, 512), (64, 256))
    read: list[int] = []

    def bands() -> Iterator[FloatArray]:
        for top in range(0, 512, 64):
            read.append(top)
            yield picture[:, top : top + 64]

    source = RollingRows(picture.shape, bands())
    stream = undistort_bands(source.reader(), BARREL, place, band_rows=64)
    first = next(stream)
    assert len(read) < 4
    rest = np.concatenate([first, *stream], axis=1)
    np.testing.assert_array_equal(rest, undistort(picture, BARREL, place))


def test_point_lands_where_the_model_says() -> None:
    place = window((257, 257), (1200, 700))
    picture = np.zeros((3, 257, 257), dtype=np.float32)
    picture[:, 100, 150] = 1
    moved = distort_array(picture, BARREL, place)[1]
    warp = Warp(BARREL, place, to_sensor=False)
    (x, y), total = np.zeros(2), moved.sum()
    rows, columns = np.mgrid[0:257, 0:257]
    x, y = float((moved * columns).sum() / total), float((moved * rows).sum() / total)
    expected = warp.positions(1, np.array(150.0), np.array(100.0))
    assert np.hypot(x - expected[0], y - expected[1]) < 0.1


def test_centre_of_a_crop_stays_in_the_centre() -> None:
    place = window((101, 81), (1300, 900))
    for to_sensor in (False, True):
        found = Warp(BARREL, place, to_sensor=to_sensor).positions(
            1, np.array(50.0), np.array(40.0)
        )
        np.testing.assert_allclose(found, (50.0, 40.0), atol=1e-6)


def test_margin_continues_the_same_picture() -> None:
    place, picture = window((128, 96), (700, 500)), band_limited(96, 128, 0.1)
    wide = distort_array(picture, BARREL, place, margin_px=9)
    assert wide.shape == (3, 96 + 18, 128 + 18)
    inner = distort_array(picture, BARREL, place)
    np.testing.assert_allclose(wide[:, 9:-9, 9:-9], inner, atol=0.01)


@pytest.mark.parametrize("channels", [1, 2, 5])
def test_every_channel_is_moved_by_its_own_model_as_if_alone(channels: int) -> None:
    rows = [(1.0 + 0.002 * c, -0.05, 0.0, 0.0) for c in range(channels)]
    model = RadialDistortion(coefficients=np.array(rows), radius_mm=RADIUS_MM)
    place = window((120, 90), (900, 600))
    picture = np.random.default_rng(0).random((channels, 90, 120), dtype=np.float32)
    warp = Warp(model, place, to_sensor=False)
    assert warp.channels == channels
    together = undistort(picture, model, place, 32)
    there = distort_array(picture, model, place)
    middle = rows[channels // 2]  # the channel by which pictures are centred
    for c in range(channels):
        pair = RadialDistortion(coefficients=np.array([rows[c], middle]), radius_mm=RADIUS_MM)
        double = np.stack([picture[c]] * 2)
        np.testing.assert_array_equal(together[c], undistort(double, pair, place, 32)[0])
        np.testing.assert_array_equal(there[c], distort_array(double, pair, place)[0])


def test_channels_of_one_model_share_their_map() -> None:
    rows = [(1.0, -0.05, 0.0, 0.0)] * 2 + [(1.01, -0.05, 0.0, 0.0)]
    warp = Warp(distortion(*rows), window((64, 64)), to_sensor=False)
    assert [warp.shares_map(c) for c in range(3)] == [False, True, False]


def test_pictures_move_about_the_axis_wherever_it_is() -> None:
    """A point on the axis stays but for the shift of the middle; all move along its radius."""
    axis_px = (400.0, 800.0)
    place = SensorWindow(
        size_px=SENSOR, origin_px=(0, 0), sensor_size_px=SENSOR, pitch_um=PITCH_UM, axis_px=axis_px
    )
    weak = distortion((1.0, -0.02, 0.0, 0.0))
    warp = Warp(weak, place, to_sensor=True)
    middle = np.array([(SENSOR[0] - 1) / 2, (SENSOR[1] - 1) / 2])
    np.testing.assert_allclose(warp.positions(1, *map(np.asarray, middle)), middle, atol=1e-6)
    on_axis = warp.positions(1, *(np.asarray(p) for p in axis_px))
    shift = on_axis - axis_px
    assert np.hypot(*shift) > 1
    for angle in (0.3, 2.0, 4.5):
        away = 150 * np.array([np.cos(angle), np.sin(angle)])
        there = warp.positions(1, *(np.asarray(p) for p in axis_px + away)) - axis_px - shift
        np.testing.assert_allclose(there / np.hypot(*there), away / 150, atol=1e-9)


def test_no_axis_gives_the_bits_of_one_in_the_middle() -> None:
    picture = np.random.default_rng(0).random((3, 90, 120), dtype=np.float32)
    plain = window((120, 90), (900, 600))
    stated = SensorWindow(
        size_px=(120, 90),
        origin_px=(900, 600),
        sensor_size_px=SENSOR,
        pitch_um=PITCH_UM,
        axis_px=((SENSOR[0] - 1) / 2, (SENSOR[1] - 1) / 2),
    )
    np.testing.assert_array_equal(*(undistort(picture, BARREL, p, 32) for p in (plain, stated)))
    np.testing.assert_array_equal(*(distort_array(picture, BARREL, p) for p in (plain, stated)))


def test_folding_model_is_refused_before_any_row() -> None:
    folding = distortion((1.0, -0.5, 0, 0))
    picture = np.zeros((3, SENSOR[1], SENSOR[0]), dtype=np.float32)
    with pytest.raises(ContractError, match="folds"):
        next(undistort_bands(ArrayRows(picture), folding, window()))


def test_sizes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ContractError, match="picture must be"):
        distort_array(np.zeros((3, 4, 5), np.float32), IDENTITY, window((4, 4)))
    with pytest.raises(ContractError, match=r"picture must be \(3, 4, 4\)"):
        distort_array(np.zeros((4, 4, 4), np.float32), IDENTITY, window((4, 4)))
    rows = ArrayRows(np.zeros((3, 4, 4), np.float32))
    with pytest.raises(ContractError, match="multiple of 8"):
        next(undistort_bands(rows, IDENTITY, window((4, 4)), band_rows=20))


def test_side_beyond_the_limit_of_remap_is_refused() -> None:
    long = SensorWindow(
        size_px=(40000, 2), origin_px=(0, 0), sensor_size_px=(40000, 2), pitch_um=1.0
    )
    with pytest.raises(UnsupportedError, match="32766"):
        distort_array(np.zeros((3, 2, 40000), np.float32), IDENTITY, long)


@pytest.mark.parametrize("threads", [2, 3])
def test_undistorted_pixels_do_not_depend_on_threads(threads: int) -> None:
    picture = np.random.default_rng(5).random((3, SENSOR[1], SENSOR[0]), dtype=np.float32)
    alone, shared = (
        list(undistort_bands(ArrayRows(picture), BARREL, window(), threads=n)) for n in (1, threads)
    )
    np.testing.assert_array_equal(np.concatenate(alone, 1), np.concatenate(shared, 1))


@pytest.mark.parametrize(("band_rows", "threads"), [(8, 1), (64, 1), (64, 3), (256, 2)])
@pytest.mark.parametrize("interpolation", ["lanczos", "cubic"])
def test_limited_pixels_depend_on_neither_bands_nor_threads(
    interpolation: Interpolation, band_rows: int, threads: int
) -> None:
    rng = np.random.default_rng(6)
    picture = rng.uniform(0, 0.1, (3, 424, 640)).astype(np.float32)
    lamps = rng.random(picture.shape) > 0.995
    picture[lamps] = rng.uniform(0.5, 200, int(lamps.sum())).astype(np.float32)
    whole, cut = (
        np.concatenate(
            list(
                undistort_bands(
                    ArrayRows(picture),
                    BARREL,
                    window((640, 424), (512, 340)),
                    band_rows=rows,
                    threads=count,
                    interpolation=interpolation,
                    overshoot="limited",
                )
            ),
            axis=1,
        )
        for rows, count in ((424, 1), (band_rows, threads))
    )
    assert whole.min() >= FLOOR
    np.testing.assert_array_equal(cut, whole)

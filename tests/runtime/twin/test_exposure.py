"""Light becomes numbers: the colour of the filter, the noise of the model, the well, the levels."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.sensor import BayerSensor, PlanesSensor
from camkit.errors import ContractError
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.twin.exposure import (
    Setting,
    expose,
    levels_of,
    noise_of,
    record,
    sample_mosaic,
)
from camkit.runtime.twin.light import Light
from tests.camera_factory import make_psf, make_sensor, whole_window
from tests.planes_bundle import planes_sensor

SENSOR = make_sensor()
ONE_DN = 1 / (4095 - 256)


def lit(planes: FloatArray, gains: tuple[float, ...] | None = None) -> Light:
    """Give light on a sensor of its own size, without vignetting."""
    count, height, width = planes.shape
    window = SensorWindow(
        size_px=(width, height), origin_px=(0, 0), sensor_size_px=(width, height), pitch_um=6.0
    )
    return Light(
        planes=planes,
        clean=planes,
        window=window,
        gains=gains or (1.0,) * count,
        vignetting=None,
    )


def flat(level: float, height: int = 20, width: int = 20, channels: int = 3) -> Light:
    return lit(np.full((channels, height, width), level, dtype=np.float32))


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_every_pixel_sees_the_colour_of_its_filter(cfa: str) -> None:
    planes = np.stack([np.full((5, 7), v, np.float32) for v in (0.2, 0.4, 0.8)])
    mosaic = sample_mosaic(planes, cfa, (2.0, 1.0, 4.0))  # type: ignore[arg-type]
    values = {"R": 0.1, "G": 0.4, "B": 0.2}
    for row in range(5):
        for column in range(7):
            letter = cfa[2 * (row % 2) + column % 2]
            assert mosaic[row, column] == pytest.approx(values[letter])


def flat_noise(level: float, setting: Setting) -> np.ndarray:
    dn = expose(flat(level, 400, 500), SENSOR, setting)
    return (dn.astype(float) - 256) * ONE_DN


# At ISO 100 the read noise is a quarter of a DN, and rounding does not add as noise there.
@pytest.mark.parametrize(
    ("iso", "level"), [(100, 0.01), (100, 0.3), (400, 0.0), (400, 0.3), (3200, 0.0), (3200, 0.3)]
)
def test_noise_has_the_mean_and_variance_of_the_model(iso: float, level: float) -> None:
    found = flat_noise(level, Setting(iso=iso, seed=3))
    noise = SENSOR.noise_at(iso)
    variance = noise.shot[0] * level + noise.read_variance[0] + ONE_DN**2 / 12
    assert found.mean() == pytest.approx(level, abs=5 * np.sqrt(variance / found.size))
    assert found.var() == pytest.approx(variance, rel=0.02)


def test_a_noise_factor_multiplies_the_deviation_and_keeps_well_and_light() -> None:
    setting = Setting(iso=400, seed=3, noise_factor=2.0)
    found, usual = flat_noise(0.3, setting), flat_noise(0.3, Setting(iso=400, seed=3))
    assert found.std() == pytest.approx(2 * usual.std(), rel=0.02)
    assert found.mean() == pytest.approx(usual.mean(), abs=2e-4)
    stated, made = SENSOR.noise_at(400), noise_of(SENSOR, setting)
    np.testing.assert_allclose(made.shot, np.multiply(stated.shot, 4))
    shallow = make_sensor(full_well_e=20_000.0)
    for factor in (1.0, 2.0):
        clipped = expose(flat(3.0), shallow, Setting(noise=False, noise_factor=factor))
        np.testing.assert_array_equal(clipped, round(256 + 20_000 / 11.72))


def test_same_seed_gives_the_same_noise_and_another_does_not() -> None:
    one, again, other = (expose(flat(0.2), SENSOR, Setting(seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.5


def test_light_beyond_white_saturates() -> None:
    assert (expose(flat(3.0), SENSOR, Setting(iso=800)) == 4095).all()


def test_small_full_well_saturates_below_white() -> None:
    shallow = make_sensor(full_well_e=20_000.0)
    dn = expose(flat(3.0), shallow, Setting(noise=False))
    np.testing.assert_array_equal(dn, round(256 + 20_000 / 11.72))


def test_read_noise_below_black_is_kept() -> None:
    dark = expose(flat(0.0, 50, 50), SENSOR, Setting(iso=6400))
    assert dark.min() < 256 < dark.max()


def test_exposure_scales_light_that_is_there_already() -> None:
    one, double = (
        expose(flat(0.2), SENSOR, Setting(noise=False, exposure=exposure)).astype(float)
        for exposure in (1.0, 2.0)
    )
    np.testing.assert_allclose(double - 256, 2 * (one - 256), atol=1)


@pytest.mark.parametrize("bits", [8, 10, 14])
def test_another_converter_keeps_the_share_of_its_black_level(bits: int) -> None:
    setting = Setting(noise=False, bits=bits)
    black, white = levels_of(SENSOR, setting)
    assert white == 2**bits - 1
    assert black / white == pytest.approx(256 / 4095, abs=0.5 / white)
    dn = expose(flat(0.5), SENSOR, setting)
    assert dn[0, 0] == pytest.approx(black + 0.5 * (white - black), abs=1)
    assert (expose(flat(0.0), SENSOR, setting) == black).all()


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_planes_of_any_number_are_exposed_channel_by_channel(count: int) -> None:
    sensor: PlanesSensor = planes_sensor(tuple("abcdefg")[:count], full_well_e=1e6)
    levels = np.linspace(0.1, 0.7, count, dtype=np.float32)
    gains = tuple(np.linspace(1.0, 2.0, count))
    light = lit(np.broadcast_to(levels[:, None, None], (count, 8, 9)).copy(), gains)
    dn = expose(light, sensor, Setting(noise=False))
    assert dn.shape == (count, 8, 9)
    expected = 64 + levels / np.array(gains) * (1023 - 64)
    np.testing.assert_allclose(dn[:, 0, 0], expected, atol=0.51)
    noisy = expose(light, sensor, Setting(seed=1))
    assert all((noisy[c] != dn[c]).any() for c in range(count))


def test_vignetting_dims_every_pixel_of_mosaic_and_planes() -> None:
    psf, window = make_psf(SENSOR, corner_light=0.4), whole_window(SENSOR)
    planes = np.full((3, 64, 96), 0.5, np.float32)
    fields = {"planes": planes, "clean": planes, "window": window, "gains": (1.0, 1.0, 1.0)}
    dim = Light(**fields, vignetting=psf)  # type: ignore[arg-type]
    wanted = 0.5 * illumination_band(psf, window, 0, 64)
    plain = planes_sensor(("R", "G", "B"), full_well_e=1e6)
    for sensor in (SENSOR, plain):
        assert isinstance(sensor, BayerSensor | PlanesSensor)
        span = sensor.white_level - sensor.black_level
        dn = expose(dim, sensor, Setting(noise=False))
        found = (dn - sensor.black_level) / span
        np.testing.assert_allclose(found, np.broadcast_to(wanted, found.shape), atol=0.51 / span)


def test_without_noise_the_pixel_counts_no_electron_twice() -> None:
    noise = SENSOR.noise_at(100)
    signal = np.linspace(0, 2, 50)
    found = record(signal, noise, 20_000.0, None)
    np.testing.assert_allclose(found, np.minimum(signal, 20_000 * noise.shot[1]), rtol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [{"iso": 0.0}, {"seed": -1}, {"exposure": float("nan")}, {"bits": 0}, {"bits": 17}],
)
def test_an_impossible_setting_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ContractError, match=r"must be|1 to 16 bits"):
        Setting(**wrong)  # type: ignore[arg-type]

"""A sensor that is known comes back from pairs; single pictures do not tell it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.calibration.noise.sensor_noise import measure_sensor
from camkit.cfa import CfaPattern
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.twin.simulate import SimulationOptions, photograph, write_capture
from tests.camkit.calibration.sensor_factory import BLACK, WHITE, Sensor, write_raw

GAIN_TOLERANCE = 0.01
READ_NOISE_TOLERANCE = 0.05
PRNU_TOLERANCE = 0.05
DRIFT_TOLERANCE = 0.015
GAINS = {100.0: 4.0, 400.0: 1.0, 1600.0: 0.25}
FEW = (0.1, 0.5)


def _rng() -> np.random.Generator:
    return np.random.default_rng(1)


@pytest.fixture(name="small")
def small_sensor() -> Sensor:
    return Sensor(_rng(), side=128)


def test_three_isos_are_found_to_one_percent(tmp_path: Path) -> None:
    darks: list[Path] = []
    flats: list[Path] = []
    for iso, gain in reversed(GAINS.items()):
        dark, flat = Sensor(_rng(), gain_e_per_dn=gain).write(tmp_path, iso)
        darks, flats = darks + dark, flats + flat
    found = measure_sensor(darks, flats)
    assert [facts.iso for facts in found.isos] == [100, 400, 1600]
    for facts in found.isos:
        gain = GAINS[facts.iso]
        record = facts.to_record()
        assert facts.gain_e_per_dn == pytest.approx(gain, rel=GAIN_TOLERANCE)
        assert 0.05 < record["gain_error_percent"] < 0.5
        assert abs(facts.gain_e_per_dn / gain - 1) < 4 * facts.gain_error
        assert record["full_well_e"] == pytest.approx(gain * (WHITE - BLACK), rel=GAIN_TOLERANCE)
        assert record["black_level"] == pytest.approx(BLACK, abs=0.05)
        assert record["white_level"] == WHITE
        assert facts.prnu == pytest.approx(0.01, rel=PRNU_TOLERANCE)
        assert record["dsnu_e"] == pytest.approx(1.5, rel=PRNU_TOLERANCE)
        assert 0 < record["linearity_percent"] < 4  # the lamp drifts by 1 %
        assert record["pairs"] == 8
        if facts.iso > 100:
            assert record["read_noise_resolved"]
            assert record["read_noise_e"] == pytest.approx(1.0, rel=READ_NOISE_TOLERANCE)


def test_read_noise_below_the_step_is_a_bound_and_said(tmp_path: Path) -> None:
    for black in (256.0, 256.5):
        sensor = Sensor(_rng(), gain_e_per_dn=4.0, dsnu_e=0.0, black=black, side=256)
        (facts,) = measure_sensor(*sensor.write(tmp_path, 100)).isos
        assert not facts.read.resolved
        assert 1.0 <= facts.read_noise_e < 2.1
        assert facts.gain_e_per_dn == pytest.approx(4.0, rel=GAIN_TOLERANCE)
    (note,) = measure_sensor(*sensor.write(tmp_path, 100)).notes
    assert "finer than the converter's step; it lies below" in note


@pytest.mark.parametrize("second", [0.92, 1.09])
def test_the_response_is_found_where_the_lamp_drifts(tmp_path: Path, second: float) -> None:
    sensor = Sensor(_rng(), drift=0.0)
    dark, flat = sensor.write(tmp_path, 400, (0.3, 0.6))
    for level, path in ((0.3, flat[1]), (0.6, flat[3])):
        write_raw(path, sensor.frame(level * second), 400, level)
    (facts,) = measure_sensor(dark, flat).isos
    assert facts.prnu == pytest.approx(0.01, rel=DRIFT_TOLERANCE)


def test_the_sensor_of_a_simulated_camera_comes_back(tmp_path: Path) -> None:
    bundle = open_bundle(Path("camkit/bundles/duet.camkit"))
    sensor = bundle.manifest.sensor
    files: dict[str, list[Path]] = {"dark": [], "flat": []}
    for number, (kind, light) in enumerate([("dark", 0.0), ("flat", 0.1), ("flat", 0.3), ("flat", 0.9)]):  # noqa: E501 # fmt: skip
        for k in range(2):
            path = tmp_path / f"{number}-{k}.dng"
            scene = np.full((3, 384, 384), light, dtype=np.float32)
            asked = SimulationOptions(iso=800.0, seed=10 * number + k, origin_px=(40, 60))
            write_capture(path, photograph(scene, bundle, asked), sensor, "duet")
            files[kind].append(path)
    (facts,) = measure_sensor(files["dark"], files["flat"]).isos
    shot, read_variance = sensor.one_noise_at(800.0)
    gain = 1 / (shot * (sensor.white_level - sensor.black_level))
    assert facts.gain_e_per_dn == pytest.approx(gain, rel=GAIN_TOLERANCE)
    assert facts.read.resolved
    assert facts.read_noise_e == pytest.approx(read_variance**0.5 / shot, rel=READ_NOISE_TOLERANCE)
    assert facts.prnu < 0.002


def test_twelve_bits_in_a_file_of_sixteen_are_seen(tmp_path: Path) -> None:
    sensor = Sensor(_rng(), gain_e_per_dn=4.0, side=256)
    dark, flat = [], []
    for n in range(10):
        path = tmp_path / f"{n}.dng"
        codes = sensor.frame(0.0 if n < 2 else 0.08 * (n // 2))
        write_raw(path, codes * np.uint16(16), 100, white=16 * (WHITE + 1) - 1)
        (dark if n < 2 else flat).append(path)
    (facts,) = measure_sensor(dark, flat).isos
    assert facts.gain_e_per_dn == pytest.approx(4.0 / 16, rel=GAIN_TOLERANCE)
    assert not facts.read.resolved
    assert 1.0 <= facts.read_noise_e < 2.1


def test_hot_pixels_do_not_count_as_noise(tmp_path: Path, small: Sensor) -> None:
    hot = _rng().choice(128 * 128, 60, replace=False)
    dark, flat = small.write(tmp_path, 400)
    plain = measure_sensor(dark, flat).isos[0]
    for path in dark:
        codes = small.frame(0.0)
        codes.reshape(-1)[hot] = _rng().integers(500, 4000, 60)
        write_raw(path, codes, 400)
    (facts,) = measure_sensor(dark, flat).isos
    assert facts.read_noise_e == pytest.approx(plain.read_noise_e, rel=READ_NOISE_TOLERANCE)
    assert 60 <= facts.to_record()["defects_percent"] / 100 * 18 * 128 * 128 <= 140


def test_headerless_mosaics_take_their_iso_from_the_caller(tmp_path: Path, small: Sensor) -> None:
    files = [tmp_path / f"{n}.png" for n in range(10)]
    for n, path in enumerate(files):
        assert cv2.imwrite(str(path), small.frame(0.0 if n < 2 else 0.1 * (n // 2)))
    cfa: CfaPattern = "GRBG"
    said = MosaicOptions(cfa=cfa, black_level=BLACK, white_level=WHITE)
    (facts,) = measure_sensor(files[:2], files[2:], said, 200.0).isos
    assert facts.iso == 200
    assert list(facts.transfers) == ["G1", "R", "B", "G2"]
    assert facts.linearity is None
    assert facts.to_record()["linearity_percent"] is None
    with pytest.raises(DecodeError, match=r"0\.png states no ISO; add iso"):
        measure_sensor(files[:2], files[2:], said)


def test_few_levels_and_sharp_things_are_said(tmp_path: Path, small: Sensor) -> None:
    dark, flat = small.write(tmp_path, 400, FEW)
    assert "only 2 levels" in measure_sensor(dark, flat).notes[0]
    paper = 1 + 0.2 * _rng().standard_normal((128, 128)).clip(-2, 2)
    for number, path in enumerate(flat):
        write_raw(path, small.frame(FEW[number // 2], paper), 400, 1.0)
    assert any("a pattern of" in note for note in measure_sensor(dark, flat).notes)


def test_colours_with_gains_of_their_own_are_said(tmp_path: Path, small: Sensor) -> None:
    dark, flat = small.write(tmp_path, 400)
    for number, path in enumerate(flat):
        codes = small.frame(0.05 * (1 + number // 2)).astype(np.float64)
        codes[::2, ::2] = BLACK + 1.3 * (codes[::2, ::2] - BLACK)
        write_raw(path, np.rint(codes).astype(np.uint16), 400, 1.0)
    found = measure_sensor(dark, flat)
    assert any("the colours differ in gain: R " in note for note in found.notes)
    assert found.isos[0].gain_error > 0.02


def _swapped(files: list[Path]) -> list[Path]:
    return [files[0], files[2], files[1], files[3]]


@pytest.mark.parametrize(
    ("level", "told"),
    [(0.99, r"flat-400-0-a\.dng: .*clipped; expose less"), (0.0, "is black in R")],
)
def test_flats_without_light_or_with_too_much_are_refused(
    tmp_path: Path, small: Sensor, level: float, told: str
) -> None:
    dark, flat = small.write(tmp_path, 400, (level, 0.3))
    with pytest.raises(DecodeError, match=told):
        measure_sensor(dark, flat)


def test_wrong_company_is_refused_and_named(tmp_path: Path, small: Sensor) -> None:
    dark, flat = small.write(tmp_path, 400, FEW)
    other_dark, other_flat = Sensor(_rng(), side=128, gain_e_per_dn=2.0).write(tmp_path, 200, FEW)
    wide = tmp_path / "wide.dng"
    write_raw(wide, np.tile(small.frame(0.1), 2), 400)
    tiny = [tmp_path / "tiny-a.dng", tmp_path / "tiny-b.dng"]
    for path in tiny:
        write_raw(path, small.frame(0.0)[:40, :40], 400)
    deep = [tmp_path / "deep-a.dng", tmp_path / "deep-b.dng"]
    for path in deep:
        write_raw(path, small.frame(0.3) * np.uint16(4), 400, white=4 * (WHITE + 1) - 1)
    copy = tmp_path / "copy.dng"
    copy.write_bytes(dark[0].read_bytes())
    cases = [
        ([flat[0], other_flat[0], *flat[2:]], "two ISOs in one pair: flat-400-0-a.dng has 400, "),
        (_swapped(flat), "differ by more than 10% in light"),
        (other_flat, "flat-200-0-a.dng has ISO 200, the dark frames 400"),
        (flat[:2], "ISO 400 has 1 pairs of flats"),
        ([flat[0], wide], "frames differ in size"),
        ([*flat, *deep], "frames differ in white level: dark-400-0.dng has 4095.0, deep-a"),
    ]
    for flats, told in cases:
        with pytest.raises(DecodeError, match=told):
            measure_sensor(dark, flats)
    for darks, told in [
        (dark + other_dark, "ISO 200 has 0 pairs of flats"),
        (tiny, "noise needs 64x64"),
        ([dark[0], copy], r"copy\.dng is the same file as dark-400-0\.dng"),
        (flat[2:], "is no dark frame"),
    ]:
        with pytest.raises(DecodeError, match=told):
            measure_sensor(darks, flat)


def test_files_that_are_no_pairs_are_refused(tmp_path: Path, small: Sensor) -> None:
    dark, flat = small.write(tmp_path, 400, FEW)
    for darks, flats, error, told in (
        (dark[:1], flat, DecodeError, "darks takes pairs"),
        (dark, flat[:3], DecodeError, "flats takes pairs"),
        ([], flat, DecodeError, "got 0 files"),
        ([dark[0], dark[0]], flat, ContractError, "is given twice"),
    ):
        with pytest.raises(error, match=told):
            measure_sensor(darks, flats)


def test_pictures_are_refused(tmp_path: Path, small: Sensor) -> None:
    _, flat = small.write(tmp_path, 400, FEW)
    for kind in ("jpg", "png"):
        files = [tmp_path / f"{n}.{kind}" for n in range(2)]
        for n, path in enumerate(files):
            assert cv2.imwrite(str(path), np.full((80, 80, 3), 9 + n, np.uint8))
        with pytest.raises(DecodeError, match="is a picture; noise is measured on RAW files"):
            measure_sensor(files, flat)


def test_darks_cut_off_at_zero_are_refused(tmp_path: Path, small: Sensor) -> None:
    small.black = 0.0
    files = [tmp_path / f"{n}.png" for n in range(6)]
    for n, path in enumerate(files):
        assert cv2.imwrite(str(path), small.frame(0.0 if n < 2 else 0.1 * (n // 2)))
    said = MosaicOptions(cfa="RGGB", black_level=0.0, white_level=WHITE)
    with pytest.raises(DecodeError, match=r"0\.png: the camera cut \d+% of the samples off at 0"):
        measure_sensor(files[:2], files[2:], said, 100.0)

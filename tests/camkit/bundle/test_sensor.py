"""What a sensor states of itself, and what follows: its inputs, its planes, its noise."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from camkit.bundle.chain import capture_plane
from camkit.bundle.sensor import (
    BayerSensor,
    IsoNoise,
    PlanesSensor,
    Sensor,
    SpadSensor,
    nested_sensor,
)
from camkit.errors import ContractError, UnsupportedError
from tests.bundle_factory import tiny_sensor

ADAPTER: TypeAdapter[Any] = TypeAdapter(Sensor)
LEVELS: dict[str, Any] = {
    "black_level": 16.0,
    "white_level": 1023.0,
    "full_well_e": 5000.0,
    "noise": [{"iso": 100.0, "gain_e_per_dn": 2.0, "read_noise_e": 1.0}],
}
MONO: dict[str, Any] = LEVELS | {"type": "planes", "channels": ["Y"]}


def _document() -> dict[str, Any]:
    return tiny_sensor().model_dump(mode="json")


def _response(rows: int, values: int = 1) -> dict[str, Any]:
    waves = np.linspace(0.4, 0.7, values).tolist()
    return {"wavelengths_um": waves, "response": [[1.0] * values] * rows, "source": ""}


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "cfa": ({"cfa": "RGBG"}, "cfa"),
    "no cfa": ({"cfa": None}, "cfa"),
    "levels": ({"black_level": 2000}, "must lie above"),
    "no noise": ({"noise": []}, "at least one ISO"),
    "singular matrix": ({"color_matrix": [[1, 1, 1]] * 3}, "cannot be inverted"),
    "absurd size": (
        {"extent": {"width_px": 10**9, "height_px": 9, "pixel_pitch_um": 1}},
        "width_px",
    ),
    "flat size": ({"width_px": 96}, "width_px"),
    "NaN": ({"full_well_e": float("nan")}, "full_well_e"),
    "inf": ({"extent": {"width_px": 9, "height_px": 9, "pixel_pitch_um": float("inf")}}, "pitch"),
    "response": (
        {"channel_response": {"wavelengths_um": [0.5], "response": [[1, 1]] * 3, "source": ""}},
        "1 values per colour",
    ),
    "rows of the response": ({"channel_response": _response(2)}, "one row for each of R, G, B"),
    "wavelengths": (
        {
            "channel_response": {
                "wavelengths_um": [0.6, 0.5],
                "response": [[1, 1]] * 3,
                "source": "",
            }
        },
        "increasing",
    ),
}


@pytest.mark.parametrize(("change", "message"), BAD.values(), ids=BAD.keys())
def test_sensor_that_cannot_be_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ADAPTER.validate_python(_document() | change)


BAD_PLANES: dict[str, tuple[dict[str, Any], str]] = {
    "no channel": ({"channels": []}, "channels"),
    "a channel twice": ({"channels": ["Y", "Y"]}, "different names"),
    "a mosaic": ({"channels": ["cfa"]}, "different names"),
    "a name with a space": ({"channels": ["near red"]}, "channels"),
    "a cfa": ({"cfa": "RGGB"}, "cfa"),
    "a matrix for one channel": ({"color_matrix": np.eye(3).tolist()}, "three channels"),
    "rows of the response": ({"channel_response": _response(3)}, "one row for each of Y"),
}


@pytest.mark.parametrize(("change", "message"), BAD_PLANES.values(), ids=BAD_PLANES.keys())
def test_planes_that_cannot_be_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ADAPTER.validate_python(MONO | change)


@pytest.mark.parametrize(
    ("document", "inputs", "channels", "axes", "domain"),
    [
        (_document(), ("raw_bayer_v1", "linear_rgb_v1"), ("cfa",), "y x", "dn"),
        (MONO, ("linear_planes_v1",), ("Y",), "y x", "dn"),
        (
            LEVELS | {"type": "planes"},
            ("linear_rgb_v1",),
            ("R", "G", "B"),
            "y x",
            "dn",
        ),
        ({"type": "spad"}, ("spad_counts_v1",), ("photons",), "y x", "counts"),
        (
            {"type": "spad", "time_bins": 64, "time_bin_ps": 50},
            ("spad_counts_v1", "spad_histogram_v1"),
            ("photons",),
            "t y x",
            "counts",
        ),
    ],
)
def test_what_a_sensor_takes_and_gives_follows_from_its_type(
    document: dict[str, Any], inputs: tuple[str, ...], channels: Any, axes: str, domain: str
) -> None:
    sensor = ADAPTER.validate_python(document)
    assert sensor.inputs == inputs
    plane = capture_plane(sensor)
    assert (plane.channels, plane.axes, plane.domain) == (channels, axes, domain)
    assert ADAPTER.validate_python(sensor.model_dump(mode="json")) == sensor


def test_bins_without_a_width_are_refused() -> None:
    with pytest.raises(ValidationError, match="time_bin_ps"):
        SpadSensor(time_bins=8)


def test_sensor_without_extent_says_so_when_asked_for_its_size() -> None:
    sensor = PlanesSensor.model_validate(MONO)
    for name in ("width_px", "height_px", "pixel_pitch_um"):
        with pytest.raises(UnsupportedError, match="pictures of any size"):
            getattr(sensor, name)
    with pytest.raises(UnsupportedError, match="no channel_response"):
        sensor.response_arrays()


def test_flat_table_becomes_nested_and_its_cfa_tells_its_type() -> None:
    extent = {"width_px": 8, "height_px": 6, "pixel_pitch_um": 3.0}
    matrix = {"color_matrix": np.diag([1.0, 2.0, 1.0]).tolist()}
    bayer = nested_sensor(LEVELS | extent | matrix | {"cfa": "RGGB"})
    assert bayer["type"] == "bayer"
    assert BayerSensor.model_validate(bayer).width_px == 8
    for none in ({}, {"cfa": None}):
        planes = nested_sensor(LEVELS | extent | matrix | none)
        assert PlanesSensor.model_validate(planes).height_px == 6
    assert "extent" not in nested_sensor(MONO)
    assert nested_sensor(MONO | {"extent": extent})["extent"] == extent
    with pytest.raises(ContractError, match="give one of them"):
        nested_sensor(MONO | extent | {"extent": extent})


# ---------------------------------------------------------------------------- noise


def test_noise_at_a_stated_iso_is_that_of_the_table() -> None:
    noise = tiny_sensor().noise_at(100)
    shot = 1 / (10.0 * (1023 - 64))
    assert noise.shot == pytest.approx([shot] * 3)
    assert noise.read_variance == pytest.approx([(4.0 * shot) ** 2] * 3)


def test_noise_between_isos_is_interpolated_over_log_iso() -> None:
    noise = tiny_sensor().noise_at(200)
    assert noise.shot[0] == pytest.approx(1 / (5.0 * 959))
    assert noise.read_variance[0] == pytest.approx((3.5 * noise.shot[0]) ** 2)


def test_noise_beyond_the_table_goes_on_as_the_gain_does() -> None:
    sensor = tiny_sensor()
    assert sensor.noise_at(1600).shot[0] == pytest.approx(4 * sensor.noise_at(400).shot[0])
    high = sensor.noise_at(1600)
    assert high.read_variance[0] == pytest.approx((3.0 * high.shot[0]) ** 2)


def test_below_the_lowest_iso_a_pixel_holds_no_more_electrons() -> None:
    sensor = tiny_sensor()
    assert sensor.noise_at(25) == sensor.noise_at(sensor.noise[0].iso)


@given(iso=st.floats(100, 25_600))
def test_shot_noise_grows_with_iso(iso: float) -> None:
    sensor = tiny_sensor()
    assert sensor.noise_at(1.1 * iso).shot[0] > sensor.noise_at(iso).shot[0]


@pytest.mark.parametrize("iso", [0.0, -100.0, float("nan"), float("inf")])
def test_iso_must_be_positive(iso: float) -> None:
    with pytest.raises(ContractError, match="iso"):
        tiny_sensor().noise_at(iso)


def test_isos_must_increase() -> None:
    twice = IsoNoise(iso=100, gain_e_per_dn=1, read_noise_e=1)
    with pytest.raises(ValidationError, match="increasing"):
        BayerSensor(**{**dict(tiny_sensor()), "noise": (twice, twice)})


def test_response_has_one_row_per_colour() -> None:
    wavelengths_um, response = tiny_sensor().response_arrays()
    assert response.shape == (3, wavelengths_um.size)
    assert np.argmax(response, axis=1).tolist() == [2, 1, 0]


def test_noise_of_planes_has_an_entry_for_each_channel() -> None:
    sensor = PlanesSensor.model_validate(MONO | {"channels": ["a", "b", "c", "d"]})
    assert len(sensor.noise_at(100).shot) == 4
    assert PlanesSensor.model_validate(MONO).noise_at(100).shot == sensor.noise_at(100).shot[:1]

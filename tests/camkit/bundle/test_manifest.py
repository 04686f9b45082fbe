"""The manifest says what it may say, and nothing else."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from camkit.bundle.manifest import (
    Camera,
    Demosaic,
    IsoNoise,
    Manifest,
    Network,
    Wiener,
    manifest_schema,
    manifest_to_bytes,
    read_manifest,
)
from camkit.errors import BundleError, ContractError
from tests.bundle_factory import tiny_camera, tiny_manifest


def _document() -> dict[str, Any]:
    document: dict[str, Any] = json.loads(manifest_to_bytes(tiny_manifest()))
    return document


def _read(document: Any) -> Manifest:
    return read_manifest(json.dumps(document).encode())


def test_manifest_comes_back_equal_and_byte_for_byte() -> None:
    data = manifest_to_bytes(tiny_manifest())
    assert read_manifest(data) == tiny_manifest()
    assert manifest_to_bytes(read_manifest(data)) == data


@settings(max_examples=30, deadline=None)
@given(
    facts=st.dictionaries(
        st.text(max_size=8), st.integers(-9, 9) | st.floats(-1e9, 1e9) | st.text(max_size=9)
    )
)
def test_freeze_report_comes_back_whatever_order_it_was_filled_in(
    facts: dict[str, int | float | str],
) -> None:
    forwards = Manifest(**{**dict(tiny_manifest()), "freeze": facts})
    backwards = Manifest(**{**dict(tiny_manifest()), "freeze": dict(reversed(facts.items()))})
    assert manifest_to_bytes(forwards) == manifest_to_bytes(backwards)
    assert read_manifest(manifest_to_bytes(forwards)) == forwards


def test_manifest_is_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        tiny_manifest().name = "other"


@pytest.mark.parametrize(
    ("version", "message"),
    [
        ("1.1", "format 1.1, a newer minor version .* update to a camkit that reads format 1.1"),
        ("2.0", "format 2.0, a newer major version .* written by camkit 0.1.0"),
        ("0.9", "never was a format 0.9"),
        ("one", "must read like 1.0"),
        ("1.0.0", "must read like 1.0"),
        ("1.٣", "must read like 1.0"),
    ],
)
def test_other_format_versions_are_refused_by_name(version: str, message: str) -> None:
    document = _document() | {"format_version": version, "new_field": {"of": "the future"}}
    with pytest.raises(BundleError, match=message):
        _read(document)


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b"null", b"\xff\xfe", b'{"name": 1}', b"[" * 100_000]
)
def test_bytes_that_are_no_manifest_are_refused(data: bytes) -> None:
    with pytest.raises(BundleError, match=r"manifest\.json cannot be read"):
        read_manifest(data)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown field": ({"surprise": 1}, "surprise"),
    "name with a slash": ({"name": "a/b"}, "name"),
    "version": ({"version": "1"}, "version"),
    "contract": ({"input_contract": "raw_bayer_v9"}, "input_contract"),
    "unknown stage": ({"stages": [{"type": "magic"}]}, "magic"),
    "stages out of order": (
        {"stages": [{"type": "color"}, {"type": "demosaic"}]},
        "in the order white_balance",
    ),
    "stage twice": ({"stages": [{"type": "color"}, {"type": "color"}]}, "once each"),
    "network stage without network": ({"networks": {}}, "no network"),
    "unknown size": ({"networks": {"XXL": {}}}, "XXL"),
    "member hash": ({"members": {"a": {"sha256": "00", "size": 1}}}, "sha256"),
    "two golden cases of one name": (
        {"golden": [{"name": "a", "iso": 100}, {"name": "a", "iso": 200}]},
        "one name",
    ),
    "envelope upside down": ({"envelope": {"iso": {"low": 2, "high": 1}}}, "lies above"),
    "plan without cost": ({"plan": {"halo": {"value": 1}}}, "cost_db"),
}


@pytest.mark.parametrize(("change", "message"), BAD.values(), ids=BAD.keys())
def test_manifest_off_the_schema_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(BundleError, match=f"breaks the schema.*{message}"):
        _read(_document() | change)


BAD_CAMERA: dict[str, tuple[dict[str, Any], str]] = {
    "cfa": ({"cfa": "RGBG"}, "cfa"),
    "no cfa": ({"cfa": None}, "raw_bayer_v1 needs a cfa"),
    "levels": ({"black_level": 2000}, "must lie above"),
    "no noise": ({"noise": []}, "at least one ISO"),
    "singular matrix": ({"color_matrix": [[1, 1, 1]] * 3}, "cannot be inverted"),
    "absurd size": ({"width_px": 10**9}, "width_px"),
    "NaN": ({"full_well_e": float("nan")}, "full_well_e"),
    "inf": ({"pixel_pitch_um": float("inf")}, "pixel_pitch_um"),
    "response": (
        {"channel_response": {"wavelengths_um": [0.5], "response": [[1, 1]] * 3, "source": ""}},
        "1 values per colour",
    ),
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


@pytest.mark.parametrize(("change", "message"), BAD_CAMERA.values(), ids=BAD_CAMERA.keys())
def test_camera_that_cannot_be_is_refused(change: dict[str, Any], message: str) -> None:
    document = _document()
    document["camera"] |= change
    with pytest.raises(BundleError, match=message):
        _read(document)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fp16_member": "h.onnx", "fp16_safe": False}, "proven range"),
        (
            {"halo_error": [{"halo_px": h, "max_abs": 0, "psnr_db": None} for h in (8, 0)]},
            "increasing halo",
        ),
    ],
)
def test_facts_that_contradict_themselves_are_refused(change: dict[str, Any], message: str) -> None:
    document = _document()
    document["networks"]["M"] |= change
    with pytest.raises(BundleError, match=message):
        _read(document)


def test_reach_is_the_larger_of_walk_and_probe() -> None:
    facts = tiny_manifest().networks["M"]
    assert facts.model_copy(update={"receptive_field_probe_px": 9}).reach_px == 9
    assert facts.model_copy(update={"receptive_field_radius_px": 8}).reach_px == 8


def test_stages_are_found_by_type() -> None:
    manifest = tiny_manifest()
    assert manifest.stage(Demosaic) == Demosaic(method="fast")
    assert manifest.model_copy(update={"stages": ()}).stage(Network) is None


def test_overlap_over_half_a_block_is_refused() -> None:
    with pytest.raises(ValidationError, match="half of block_px"):
        Wiener(block_px=64, overlap_px=33, prior_scale=1, prior_exponent=2)


def test_schema_is_closed_and_names_every_stage() -> None:
    schema = manifest_schema()
    assert schema["additionalProperties"] is False
    text = json.dumps(schema)
    for stage in tiny_manifest().stages:
        assert f'"const": "{stage.type}"' in text


# ---------------------------------------------------------------------------- noise


def test_noise_at_a_stated_iso_is_that_of_the_table() -> None:
    noise = tiny_camera().noise_at(100)
    shot = 1 / (10.0 * (1023 - 64))
    assert noise.shot == pytest.approx([shot] * 3)
    assert noise.read_variance == pytest.approx([(4.0 * shot) ** 2] * 3)


def test_noise_between_isos_is_interpolated_over_log_iso() -> None:
    noise = tiny_camera().noise_at(200)
    assert noise.shot[0] == pytest.approx(1 / (5.0 * 959))
    assert noise.read_variance[0] == pytest.approx((3.5 * noise.shot[0]) ** 2)


def test_noise_beyond_the_table_goes_on_as_the_gain_does() -> None:
    camera = tiny_camera()
    assert camera.noise_at(1600).shot[0] == pytest.approx(4 * camera.noise_at(400).shot[0])
    high = camera.noise_at(1600)
    assert high.read_variance[0] == pytest.approx((3.0 * high.shot[0]) ** 2)


def test_below_the_lowest_iso_a_pixel_holds_no_more_electrons() -> None:
    camera = tiny_camera()
    assert camera.noise_at(25) == camera.noise_at(camera.noise[0].iso)


@given(iso=st.floats(100, 25_600))
def test_shot_noise_grows_with_iso(iso: float) -> None:
    camera = tiny_camera()
    assert camera.noise_at(1.1 * iso).shot[0] > camera.noise_at(iso).shot[0]


@pytest.mark.parametrize("iso", [0.0, -100.0, float("nan"), float("inf")])
def test_iso_must_be_positive(iso: float) -> None:
    with pytest.raises(ContractError, match="iso"):
        tiny_camera().noise_at(iso)


def test_isos_must_increase() -> None:
    twice = IsoNoise(iso=100, gain_e_per_dn=1, read_noise_e=1)
    with pytest.raises(ValidationError, match="increasing"):
        Camera(**{**dict(tiny_camera()), "noise": (twice, twice)})


def test_response_has_one_row_per_colour() -> None:
    wavelengths_um, response = tiny_camera().channel_response.to_arrays()
    assert response.shape == (3, wavelengths_um.size)
    assert np.argmax(response, axis=1).tolist() == [2, 1, 0]

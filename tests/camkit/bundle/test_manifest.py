"""The manifest says what it may say, and nothing else; see test_chain for its stages."""

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from camkit.bundle.manifest import Manifest, manifest_schema, manifest_to_bytes, read_manifest
from camkit.bundle.stages import Demosaic, Network, Wiener
from camkit.errors import BundleError
from tests.bundle_factory import tiny_facts, tiny_manifest, tiny_stages


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
        ("1.1", r"format 1.1, a newer minor version .*\(1.0\); update .* reads format 1.1"),
        ("2.13", r"format 2.13, a newer minor .*\(2.12\); update .* reads format 2.13"),
        ("3.0", "format 3.0, a newer major version .* written by camkit 0.1.0"),
        ("0.9", "never was a format 0.9"),
        ("one", "must read like 2.0"),
        ("1.0.0", "must read like 2.0"),
        ("1.٣", "must read like 2.0"),
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
    "field of 1.0": ({"input_contract": "raw_bayer_v1"}, "input_contract"),
    "name with a slash": ({"name": "a/b"}, "name"),
    "kind with a slash": ({"kind": "a/b"}, "kind"),
    "version": ({"version": "1"}, "version"),
    "unknown stage": ({"stages": [{"type": "magic"}]}, "magic"),
    "unknown sensor": ({"sensor": {"type": "eye"}}, "eye"),
    "unknown optics": ({"optics": {"type": "pinhole", "pixel_pitch_um": 6}}, "optics"),
    "another member of the optics": (
        {"optics": {"member": "../psf.safetensors", "pixel_pitch_um": 6}},
        "member",
    ),
    "role with a slash": ({"networks": {"a/b": {}}}, "networks"),
    "size with a slash": ({"networks": {"restore": {"../M": {}}}}, "networks"),
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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fp16_member": "h.onnx", "fp16_safe": False}, "proven range"),
        (
            {"halo_error": [{"halo_px": h, "max_abs": 0, "psnr_db": None} for h in (8, 0)]},
            "increasing halo",
        ),
        ({"inputs": [{"name": "capture", "channels": 6, "scale": 2}]}, "scale 1"),
        ({"inputs": []}, "inputs"),
        (
            {"outputs": [{"name": n, "channels": 3, "scale": s} for n, s in (("a", 1), ("b", 2))]},
            "one scale",
        ),
        ({"outputs": [{"name": "clean", "channels": 3, "scale": 17}]}, "scale"),
    ],
)
def test_facts_that_contradict_themselves_are_refused(change: dict[str, Any], message: str) -> None:
    document = _document()
    document["networks"]["restore"]["M"] |= change
    with pytest.raises(BundleError, match=message):
        _read(document)


def test_reach_is_the_larger_of_walk_and_probe() -> None:
    facts = tiny_facts()
    assert facts.model_copy(update={"receptive_field_probe_px": 9}).reach_px == 9
    assert facts.model_copy(update={"receptive_field_radius_px": 8}).reach_px == 8


def test_stages_are_found_by_type() -> None:
    manifest = tiny_manifest()
    assert manifest.stage(Demosaic) == Demosaic(method="fast")
    assert tiny_manifest(stages=tiny_stages("network"), networks={}).stage(Network) is None


def test_sizes_are_those_of_every_role_by_their_work() -> None:
    facts = tiny_facts()
    large = facts.model_copy(update={"mac_per_pixel": 9e4})
    both = {"S": facts, "M": large, "L": facts}
    manifest = tiny_manifest(networks={"restore": {"M": large, "S": facts}})
    assert manifest.sizes == ("S", "M")
    two = manifest.model_copy(update={"networks": {"restore": both, "again": {"M": large}}})
    assert two.sizes == ("M",)
    assert two.mac_per_pixel("M") == 2 * 9e4
    assert tiny_manifest(stages=tiny_stages("network"), networks={}).sizes == ()


def test_overlap_over_half_a_block_is_refused() -> None:
    with pytest.raises(ValidationError, match="half of block_px"):
        Wiener(block_px=64, overlap_px=33, prior_scale=1, prior_exponent=2)


def test_schema_is_closed_and_names_every_stage() -> None:
    schema = manifest_schema()
    assert schema["additionalProperties"] is False
    text = json.dumps(schema)
    for stage in tiny_manifest().stages:
        assert f'"const": "{stage.type}"' in text

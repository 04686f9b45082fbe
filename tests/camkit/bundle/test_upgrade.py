"""Manifests of format 1.0 are read for ever; hostile ones are refused as they were."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camkit.bundle.manifest import Manifest, manifest_to_bytes, read_manifest
from camkit.bundle.sensor import BayerSensor, PlanesSensor
from camkit.bundle.stages import Demosaic, Network, Wiener
from camkit.errors import BundleError

EXAMPLE = Path(__file__).resolve().parents[2] / "data" / "example-1.0.camkit"
USUAL = (
    *("linearise", "repair", "white_balance", "demosaic", "wiener", "network", "raise_clipped"),
    *("illumination", "undistort", "color"),
)
Document = dict[str, Any]


def document() -> Document:
    """The manifest of a bundle that was written when 1.0 was the newest format."""
    with zipfile.ZipFile(EXAMPLE) as archive:
        read: Document = json.loads(archive.read("manifest.json"))
    return read


def _read(found: Document) -> Manifest:
    return read_manifest(json.dumps(found).encode())


def _types(manifest: Manifest) -> tuple[str, ...]:
    return tuple(stage.type for stage in manifest.stages)


def test_manifest_of_1_0_lists_all_that_was_done() -> None:
    manifest = _read(document())
    assert manifest.format_version == "2.0"
    assert manifest.kind == "bayer"
    assert isinstance(manifest.sensor, BayerSensor)
    assert manifest.sensor.width_px == 96
    assert _types(manifest) == USUAL
    assert manifest.products == {"image": "picture"}
    assert manifest.stage(Demosaic) == Demosaic(method="fast")
    bank = manifest.stage(Wiener)
    assert bank is not None
    assert (bank.block_px, bank.overlap_px, bank.prior_scale) == (32, 8, 0.001)
    facts = manifest.networks["restore"]["M"]
    assert [(port.name, port.channels) for port in facts.inputs] == [("capture", 3), ("wiener", 3)]
    assert facts.output_channels == 3
    assert facts.member == "network_m.onnx"
    assert manifest.optics is not None
    assert manifest.optics.symmetry == "radial"
    assert manifest.optics.pixel_pitch_um == 6.0
    assert manifest.optics.object_distance_mm is None


def test_what_was_brought_up_to_date_is_a_manifest_of_2_0() -> None:
    manifest = _read(document())
    assert read_manifest(manifest_to_bytes(manifest)) == manifest


@pytest.mark.parametrize(
    ("left_out", "takes"),
    [
        ((), ("rgb", "unknown")),
        (("white_balance", "demosaic", "color"), ("rgb", "unknown")),
        (("illumination",), ("rgb", "unknown")),
    ],
)
def test_stages_that_were_done_anyway_are_listed(
    left_out: tuple[str, ...], takes: tuple[str, ...]
) -> None:
    found = document()
    found["stages"] = [stage for stage in found["stages"] if stage["type"] not in left_out]
    manifest = _read(found)
    done_if_listed = {"wiener", "network", "illumination", "undistort"}
    missing = done_if_listed & set(left_out)
    assert _types(manifest) == tuple(name for name in USUAL if name not in missing)
    bank = manifest.stage(Wiener)
    assert bank is not None
    assert bank.takes == takes


def test_bundle_that_only_develops_needs_no_optics() -> None:
    found = document() | {"stages": [], "networks": {}, "members": {}, "golden": []}
    manifest = _read(found)
    assert manifest.optics is None
    assert _types(manifest) == (
        *("linearise", "repair", "white_balance", "demosaic", "raise_clipped", "color"),
    )


def test_bank_without_a_network_is_what_comes_out() -> None:
    found = document()
    found["stages"] = [stage for stage in found["stages"] if stage["type"] != "network"]
    found["networks"] = {}
    manifest = _read(found)
    assert _types(manifest) == tuple(name for name in USUAL if name != "network")
    assert next(s for s in manifest.stages if s.type == "raise_clipped").takes == ("restored",)


@pytest.mark.parametrize("cfa", ["RGGB", None])
@pytest.mark.parametrize("listed", [True, False])
def test_linear_rgb_has_planes_and_no_mosaic(cfa: str | None, *, listed: bool) -> None:
    found = document() | {"input_contract": "linear_rgb_v1"}
    found["camera"]["cfa"] = cfa
    if not listed:
        found["stages"] = [stage for stage in found["stages"] if stage["type"] != "demosaic"]
    manifest = _read(found)
    assert isinstance(manifest.sensor, PlanesSensor)
    assert manifest.sensor.color_matrix is not None
    assert _types(manifest) == tuple(
        name for name in USUAL if name not in ("demosaic", "raise_clipped")
    )
    assert manifest.stage(Network) is not None


def _set(**changes: Any) -> Callable[[Document], object]:
    return lambda found: found.update(changes)


def _within(name: str, **changes: Any) -> Callable[[Document], object]:
    return lambda found: found[name].update(changes)


def _stage(kind: str, **changes: Any) -> Callable[[Document], object]:
    def change(found: Document) -> None:
        next(stage for stage in found["stages"] if stage["type"] == kind).update(changes)

    return change


def _facts(**changes: Any) -> Callable[[Document], object]:
    return lambda found: found["networks"]["M"].update(changes)


def _without(*kinds: str) -> Callable[[Document], object]:
    def change(found: Document) -> None:
        found["stages"] = [stage for stage in found["stages"] if stage["type"] not in kinds]

    return change


RESPONSE = {"wavelengths_um": [0.5], "response": [[1, 1]] * 3, "source": ""}
HOSTILE: dict[str, tuple[Callable[[Document], object], str]] = {
    "unknown field": (_set(surprise=1), "surprise"),
    "field of 2.0": (_set(sensor={"type": "spad"}), "sensor: extra inputs"),
    "planes of 2.0": (_set(planes={}), "planes: extra inputs"),
    "kind of 2.0": (_set(kind="bayer"), "kind: extra inputs"),
    "name with a slash": (_set(name="a/b"), "name"),
    "version": (_set(version="1"), "version"),
    "contract": (_set(input_contract="raw_bayer_v9"), "input_contract"),
    "counts": (_set(input_contract="spad_counts_v1"), "no sensor for spad_counts_v1"),
    "unknown stage": (_set(stages=[{"type": "magic"}]), "no stage 'magic'"),
    "stage of 2.0": (_set(stages=[{"type": "repair"}]), "no stage 'repair'"),
    "stage without a type": (_set(stages=[{}]), "no stage None"),
    "stage of an odd type": (_set(stages=[{"type": ["color"]}]), "no stage"),
    "stage that is none": (_set(stages=["color"]), "stages"),
    "stages out of order": (
        _set(stages=[{"type": "color"}, {"type": "demosaic"}]),
        "in the order white_balance",
    ),
    "stage twice": (_set(stages=[{"type": "color"}] * 2), "once each"),
    "planes of a stage": (_stage("color", takes=["rgb"]), "extra inputs"),
    "role of a network": (_stage("network", role="restore"), "extra inputs"),
    "unknown key of a stage": (_stage("wiener", magic=1), "stages.magic"),
    "overlap": (_stage("wiener", overlap_px=99), "half of block_px"),
    "network stage without network": (_set(networks={}), "no network"),
    "network without its stage": (_without("network"), "no network stage"),
    "network without a bank": (_without("wiener"), "have no bank"),
    "unknown size": (_set(networks={"XXL": {}}), "XXL"),
    "networks that are none": (_set(networks=[]), "networks"),
    "inputs of 2.0": (_facts(inputs=[]), "extra inputs"),
    "channels of another network": (_facts(input_channels=4), "given 6 planes; this one takes 4"),
    "outputs of another network": (_facts(output_channels=4), "noise of R, G, B"),
    "channels that are no number": (_facts(output_channels="three"), "whole numbers"),
    "fp16 without proof": (_facts(fp16_member="h.onnx", fp16_safe=False), "proven range"),
    "member hash": (_set(members={"a": {"sha256": "00", "size": 1}}), "sha256"),
    "members that are none": (_set(members=None), "members"),
    "members in a list": (_set(members=["psf.safetensors"]), "members"),
    "two golden cases of one name": (
        _set(golden=[{"name": "a", "iso": 100}, {"name": "a", "iso": 200}]),
        "one name",
    ),
    "envelope upside down": (_set(envelope={"iso": {"low": 2, "high": 1}}), "lies above"),
    "plan without cost": (_set(plan={"halo": {"value": 1}}), "cost_db"),
    "distance": (_set(object_distance_mm=-1), "object_distance_mm"),
    "freeze that is NaN": (_set(freeze={"loss_db": float("nan")}), "freeze"),
    "cfa": (_within("camera", cfa="RGBG"), "cfa"),
    "no cfa": (_within("camera", cfa=None), "raw_bayer_v1 needs a cfa"),
    "levels": (_within("camera", black_level=2000), "must lie above"),
    "no noise": (_within("camera", noise=[]), "at least one ISO"),
    "singular matrix": (_within("camera", color_matrix=[[1, 1, 1]] * 3), "cannot be inverted"),
    "no matrix": (_within("camera", color_matrix=None), "color_matrix: field required"),
    "absurd size": (_within("camera", width_px=10**9), "width_px"),
    "NaN": (_within("camera", full_well_e=float("nan")), "full_well_e"),
    "inf": (_within("camera", pixel_pitch_um=float("inf")), "pixel_pitch_um"),
    "response": (_within("camera", channel_response=RESPONSE), "1 values per colour"),
    "no response": (_within("camera", channel_response=None), "field required"),
    "type of 2.0": (_within("camera", type="bayer"), "extra inputs"),
    "centre of 2.0": (_within("camera", optical_centre_px=[0, 0]), "extra inputs"),
    "unknown key of the camera": (_within("camera", eye=1), "eye"),
    "camera that is none": (_set(camera=[]), "camera"),
}


@pytest.mark.parametrize(("change", "message"), HOSTILE.values(), ids=HOSTILE.keys())
def test_manifest_of_1_0_off_its_schema_is_refused(
    change: Callable[[Document], object], message: str
) -> None:
    found = document()
    change(found)
    with pytest.raises(BundleError, match=f"(?s)breaks the schema of format 1.0.*{message}"):
        _read(found)


@pytest.mark.parametrize(
    "junk", ["9" * 5000, "1e999", "-Infinity", '"\\ud800"', "[" * 3000 + "]" * 3000, '{"a":null}']
)
@pytest.mark.parametrize("place", ["freeze", "licence", "stages", "camera", "surprise"])
def test_values_that_upset_readers_are_bundle_errors(junk: str, place: str) -> None:
    text = json.dumps(document() | {place: "JUNK"}).replace('"JUNK"', junk)
    with pytest.raises(BundleError):
        read_manifest(text.encode())


@pytest.mark.parametrize("version", ["1.00", "01.0"])
def test_odd_spellings_of_1_0_are_refused(version: str) -> None:
    with pytest.raises(BundleError, match="breaks the schema"):
        _read(document() | {"format_version": version})

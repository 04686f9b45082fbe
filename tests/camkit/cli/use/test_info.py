"""`camkit info`: bundles, captures and the schema, for people and for programs."""

import json
import re
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from camkit.bundle.manifest import Manifest, manifest_to_bytes, read_manifest
from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import open_bundle
from camkit.cli.exit_code import ExitCode
from camkit.models_def.optics.measured import measured_psf
from camkit.psf import PsfUncertainty
from camkit.runtime.files.doubts import NOTHING_DARK
from camkit.runtime.raw import read_capture

EXAMPLE = Path(__file__).resolve().parents[3] / "data" / "example-1.0.camkit"
KINDS: dict[str, Any] = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
    "boolean": bool,
    "null": type(None),
}


def test_a_bundle_is_described_without_its_list_of_hashes(captures, camkit_command) -> None:
    facts = json.loads(camkit_command("info", "tiny.camkit", "--json").out)
    assert facts["name"] == "tiny"
    assert facts["sha256"] == open_bundle(captures / "tiny.camkit").sha256
    assert facts["psf"]["kernels"] == [2, 1, 3, 5, 5]
    assert facts["psf"]["depths"] == ["infinity"]
    assert "members" not in facts
    text = camkit_command("info", "tiny.camkit").out
    assert "name: tiny" in text
    assert "  pixel_pitch_um: 6.0" in text


@pytest.mark.parametrize(
    ("name", "command"), [("a.zmx", "camkit lens show"), ("a.onnx", "camkit network inspect")]
)
def test_a_file_of_another_command_names_that_command(
    name: str, command: str, camkit_command
) -> None:
    outcome = camkit_command("info", name)
    assert outcome.code == ExitCode.USAGE
    assert command in outcome.err


def test_numbers_that_fill_lines_are_cut_for_people_alone(camkit_command) -> None:
    text = camkit_command("info", "duet").out
    (bank,) = [line for line in text.splitlines() if "type wiener" in line]
    assert len(bank) < 1000
    assert "characters more, see --json)" in bank
    whole = json.loads(camkit_command("info", "duet", "--json").out)
    (stage,) = [stage for stage in whole["stages"] if stage["type"] == "wiener"]
    assert len(str(stage)) > 3000


def test_laws_of_a_picture_are_lines_for_people_and_shares_for_programs(camkit_command) -> None:
    laws = json.loads(camkit_command("info", "duet", "--json").out)["laws"]
    flat = laws["M"]["flat"]
    assert 0 <= flat["worst"] < flat["limit"] == 0.01
    text = camkit_command("info", "duet").out
    assert f"    flat: {100 * flat['worst']:.2f} % (at most 1.00 %)\n" in text


def test_a_capture_is_described_with_its_place_on_the_sensor(captures, camkit_command) -> None:
    facts = json.loads(camkit_command("info", "a.dng", "--json").out)
    assert (facts["width"], facts["height"], facts["cfa"]) == (96, 64, "RGGB")
    assert facts["bundle_named"] == "tiny"
    assert facts["origin_px"] == [0, 0]
    assert facts["iso"] == 100


def test_a_capture_that_its_own_haze_lifts_is_not_described_as_fog(
    camkit_command, tmp_path: Path
) -> None:
    """Bright surroundings leave nothing dark behind thin-plate."""
    tones = np.full((128, 192, 3), 235, np.uint8)
    tones[48:80, 64:128] = 30
    cv2.imwrite(str(tmp_path / "scene.png"), tones)
    capture = tmp_path / "veiled.dng"
    made = ["simulate", str(tmp_path / "scene.png"), "--bundle", "thin-plate", "-o", str(capture)]
    assert camkit_command(*made).code == 0
    assert any(note.startswith(NOTHING_DARK) for note in read_capture(capture).notes)
    described = json.loads(camkit_command("info", str(capture), "--json").out)
    assert described["bundle_named"] == "thin-plate"
    assert described["notes"] == []


def test_a_headerless_mosaic_is_described_with_its_options(captures, camkit_command) -> None:
    cv2.imwrite(str(captures / "bare.png"), np.full((8, 10), 100, np.uint16))
    options = ("--mosaic", "GRBG", "--black-level", "25", "--white-level", "1023")
    facts = json.loads(camkit_command("info", "bare.png", *options, "--json").out)
    assert (facts["contract"], facts["cfa"]) == ("raw_bayer_v1", "GRBG")


def _faults(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> list[str]:
    """Hold a value against the part of JSON schema that pydantic writes."""
    if "$ref" in schema:
        return _faults(value, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root)
    choices = schema.get("anyOf", schema.get("oneOf"))
    if choices is not None:
        fits = any(_faults(value, one, root) == [] for one in choices)
        return [] if fits else [f"{value!r} fits none"]
    if value not in schema.get("enum", [schema.get("const", value)]):
        return [f"{value!r} is not one of the allowed"]
    if "type" in schema and not isinstance(value, KINDS[schema["type"]]):
        return [f"{value!r} is no {schema['type']}"]
    if isinstance(value, dict):
        return _object_faults(value, schema, root)
    if isinstance(value, list):
        prefix = schema.get("prefixItems", [])
        kinds = [*prefix, *[schema.get("items", {})] * (len(value) - len(prefix))]
        pairs = zip(value, kinds, strict=True)
        return [fault for item, kind in pairs for fault in _faults(item, kind, root)]
    return []


def _object_faults(
    value: dict[str, Any], schema: dict[str, Any], root: dict[str, Any]
) -> list[str]:
    known, rest = schema.get("properties", {}), schema.get("additionalProperties", True)
    patterns = schema.get("patternProperties", {})
    found = [f"lacks {name}" for name in schema.get("required", []) if name not in value]
    for name, item in value.items():
        if name not in known and rest is False:
            found.append(f"{name} is unknown")
        matching = (kind for pattern, kind in patterns.items() if re.search(pattern, name))
        kind = known.get(name, next(matching, rest if isinstance(rest, dict) else {}))
        found += _faults(item, kind, root)
    return found


def test_the_schema_describes_the_example_brought_up_to_date_and_nothing_more(
    camkit_command,
) -> None:
    schema = json.loads(camkit_command("info", "--schema").out)
    assert set(schema["properties"]) == set(Manifest.model_fields)
    with ZipFile(EXAMPLE) as archive:
        old = archive.read("manifest.json")
    manifest = json.loads(manifest_to_bytes(read_manifest(old)))
    assert _faults(manifest, schema, schema) == []
    assert _faults(json.loads(old), schema, schema)
    assert _faults(manifest | {"surprise": 1}, schema, schema)
    assert _faults(manifest | {"sensor": {"type": "film"}}, schema, schema)
    assert _faults(manifest | {"networks": {"restore": {"XL": {}}}}, schema, schema)


@pytest.mark.parametrize(
    ("file", "code"),
    [("absent.dng", ExitCode.INPUT_FAILED), ("absent", 3), ("absent.camkit", 3)],
)
def test_what_is_not_there_ends_with_its_code(
    captures, camkit_command, file: str, code: int
) -> None:
    outcome = camkit_command("info", file)
    assert outcome.code == code
    assert file in outcome.err


def test_no_file_and_no_schema_is_a_usage_error(camkit_command) -> None:
    assert camkit_command("info").code == ExitCode.USAGE


@pytest.mark.parametrize("uncertainty", [None, PsfUncertainty(noise=0.02)])
def test_a_psf_is_described_by_places_span_colours_and_widths(
    uncertainty: PsfUncertainty | None, camkit_command, tmp_path: Path
) -> None:
    y, x = np.mgrid[-15:16, -15:16]
    sigmas = np.array([1.5, 2.0, 3.0])
    kernels = np.exp(-(x**2 + y**2) / (2 * sigmas[:, None, None] ** 2)) * np.ones((2, 3, 3, 1, 1))
    psf = measured_psf(
        kernels.reshape(2, 3, 3, 31, 31),
        pixel_pitch_um=4.0,
        wavelengths_um=(0.46, 0.54, 0.6),
        grid_mm=(np.array([-6.0, 0.0, 6.0]), np.array([-4.0, 4.0])),
    )
    path = tmp_path / "lab.psf.safetensors"
    write_psf(path, psf, uncertainty)
    facts = json.loads(camkit_command("info", str(path), "--json").out)
    assert (facts["places"], facts["symmetry"], facts["colours"]) == (6, "grid", 3)
    assert (facts["span_mm"], facts["pixel_pitch_um"], facts["side_px"]) == ([12.0, 8.0], 4.0, 31)
    assert facts["sigma_px"] == pytest.approx([1.5, 3.0], abs=2e-3)
    # of a Gaussian: sigma sqrt(2 ln 2)
    assert facts["half_light_px"] == pytest.approx([1.766, 3.532], abs=0.05)
    assert ("measured" in facts["source"]) == (uncertainty is not None)
    assert (facts["uncertainty"] or {}).get("noise") == (0.02 if uncertainty else None)
    text = camkit_command("info", str(path)).out
    assert "places: 6" in text
    assert ("uncertainty:" in text) == (uncertainty is not None)


@pytest.mark.parametrize("data", [b"", b"no tensors at all", None])
def test_a_file_that_is_no_psf_is_refused_by_its_name(
    data: bytes | None, camkit_command, tmp_path: Path
) -> None:
    path = tmp_path / "lab.safetensors"
    if data is not None:
        path.write_bytes(data)
    outcome = camkit_command("info", str(path))
    assert outcome.code not in (0, None)
    assert "lab.safetensors" in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1


def test_a_sidecar_is_described_in_words_and_printed_whole(captures, camkit_command) -> None:
    camkit_command("process", "a.dng", "--bundle", "tiny.camkit", "--out-dir", "out")
    sidecar = captures / "out" / "a.camkit.json"
    lines = camkit_command("info", sidecar).out.splitlines()
    assert lines[0] == "a.dng -> out/a.exr"
    assert any("made with the bundle tiny and its network M" in line for line in lines)
    assert any(line.startswith("Warning: in ") for line in lines)
    printed = camkit_command("info", sidecar, "--json").out
    record = json.loads(sidecar.read_text())
    assert json.loads(printed) == record
    record["plan"]["envelope"] = {"seen": {}, "outside": [], "fallback": False}
    sidecar.write_text(json.dumps(record))
    assert "lies inside the measured range" in camkit_command("info", sidecar).out


@pytest.mark.parametrize("text", ["", "{}", "[1]", None])
def test_a_sidecar_that_is_damaged_or_gone_is_refused_in_one_line(
    tmp_path, camkit_command, text
) -> None:
    sidecar = tmp_path / "a.camkit.json"
    if text is not None:
        sidecar.write_text(text)
    outcome = camkit_command("info", sidecar)
    assert outcome.code == ExitCode.INPUT_FAILED
    assert len(outcome.err.splitlines()) == 1
    assert ("is damaged" if text is not None else "no such file") in outcome.err

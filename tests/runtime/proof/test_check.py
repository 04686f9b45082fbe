"""A good bundle proves itself; one that does not keep its word fails in the right layer."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import helper

from camkit.bundle.golden import GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase, Manifest
from camkit.bundle.reader import Bundle
from camkit.bundle.writer import write_bundle
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.runtime.proof.check import LAYERS, CheckReport, check_bundle
from tests.bundle_factory import (
    make_model,
    make_weight,
    tiny_facts,
    tiny_golden,
    tiny_manifest,
    tiny_members,
    tiny_network,
    write_tiny_bundle,
)
from tests.disk_watch import nothing_written


def _write(folder: Path, manifest: Manifest, **members: bytes) -> Path:
    named = {name.replace("__", "."): data for name, data in members.items()}
    write_bundle(folder / "b.camkit", manifest, tiny_members() | named)
    return folder / "b.camkit"


def _with_facts(**change: Any) -> Manifest:
    facts = {"M": tiny_facts().model_copy(update=change)}
    return tiny_manifest().model_copy(update={"networks": facts})


def _states(report: CheckReport) -> dict[str, str]:
    return {layer.name: layer.status for layer in report.layers}


def _message(report: CheckReport, name: str) -> str:
    return next(layer.message for layer in report.layers if layer.name == name)


def test_good_bundle_passes_every_layer_without_touching_the_disk(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    with nothing_written():
        report = check_bundle(path)
    assert _states(report) == dict.fromkeys(LAYERS, "pass")
    assert report.passed
    assert json.loads(json.dumps(report.to_json()))["passed"] is True
    assert len(report.lines()) == len(LAYERS)


@pytest.mark.parametrize(
    ("level", "layers"),
    [
        ("schema", ["schema"]),
        ("hash", ["schema", "hash"]),
        ("graph", ["schema", "hash", "graph"]),
        ("range", ["schema", "hash", "graph", "range"]),
    ],
)
def test_a_level_brings_what_it_stands_on(tmp_path: Path, level: str, layers: list[str]) -> None:
    report = check_bundle(write_tiny_bundle(tmp_path), level)
    assert list(_states(report)) == layers


def test_unknown_level_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="level must be all"):
        check_bundle(tmp_path / "x", "everything")


def test_file_that_is_no_bundle_fails_the_schema_and_skips_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "x.camkit"
    path.write_bytes(b"nonsense")
    report = check_bundle(path)
    assert _states(report) == {"schema": "fail"} | dict.fromkeys(LAYERS[1:], "skip")
    assert not report.passed
    assert "not a zip" in _message(report, "schema")
    assert _message(report, "range") == "needs schema"


def test_changed_member_fails_the_hash(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    data = bytearray(path.read_bytes())
    data[data.find(b"# tiny")] ^= 1
    path.write_bytes(data)
    states = _states(check_bundle(path))
    assert (states["schema"], states["hash"], states["tiling"]) == ("pass", "fail", "skip")


FALSE_FACTS: dict[str, tuple[dict[str, Any], str, str]] = {
    "stride": ({"stride_px": 4}, "graph", "stride"),
    "reach": (
        {"receptive_field_radius_px": 1, "receptive_field_probe_px": 1},
        "graph",
        "reaches 3 px, the manifest says 1",
    ),
    "cost": ({"mac_per_pixel": 10.0}, "graph", "mac_per_pixel is 360"),
    "flattered memory": ({"bytes_per_pixel": 10.0}, "graph", "bytes_per_pixel"),
    "activations": ({"max_activation": 1.0}, "range", "the manifest says 1"),
    "fp16": ({"max_activation": 5000.0}, "range", "fp16 is claimed"),
    "fp16 of one node": ({"node_activation": {"head": 60000.0}}, "range", "fp16 is claimed"),
}


@pytest.mark.parametrize(
    ("change", "layer", "message"), FALSE_FACTS.values(), ids=FALSE_FACTS.keys()
)
def test_false_fact_fails_in_its_layer(
    tmp_path: Path, change: dict[str, Any], layer: str, message: str
) -> None:
    report = check_bundle(_write(tmp_path, _with_facts(**change)))
    assert _states(report)[layer] == "fail"
    assert message in _message(report, layer)


def test_memory_measured_above_the_count_is_believed(tmp_path: Path) -> None:
    report = check_bundle(_write(tmp_path, _with_facts(bytes_per_pixel=999.0)), "graph")
    assert report.passed


def test_fp16_of_a_network_beyond_its_range_fails_though_cpu_output_is_finite(
    tmp_path: Path,
) -> None:
    manifest = _with_facts(max_activation=1e9)
    report = check_bundle(_write(tmp_path, manifest, network_m__onnx=tiny_network(scale=1e5)))
    assert _states(report)["range"] == "fail"
    assert "fp16 is claimed" in _message(report, "range")


def test_other_weights_fail_the_golden_case(tmp_path: Path) -> None:
    path = _write(tmp_path, tiny_manifest(), network_m__onnx=tiny_network(seed=9))
    report = check_bundle(path)
    assert _states(report)["golden"] == "fail"
    assert "differs from the stored result" in _message(report, "golden")


def test_golden_cases_of_other_names_fail(tmp_path: Path) -> None:
    manifest = tiny_manifest().model_copy(update={"golden": (GoldenCase(name="dark", iso=1),)})
    report = check_bundle(_write(tmp_path, manifest))
    assert "the manifest has the golden cases dark" in _message(report, "golden")


def _golden_with_output(output: FloatArray) -> bytes:
    case = tiny_golden()["typical"]
    arrays = GoldenArrays(capture=case.capture, reference=case.reference, outputs={"M": output})
    return golden_to_bytes({"typical": arrays})


def test_pipeline_is_run_on_the_capture_and_compared(tmp_path: Path) -> None:
    stored = np.full((3, 32, 48), 0.5, np.float32)
    path = _write(tmp_path, tiny_manifest(), golden__safetensors=_golden_with_output(stored))
    asked = []

    def run(error: float) -> Callable[[Bundle, GoldenCase, GoldenArrays, str], FloatArray]:
        def pipeline(
            bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str
        ) -> FloatArray:
            asked.append((bundle.manifest.name, case.iso, arrays.capture.shape, size))
            return stored + np.float32(error)

        return pipeline

    allowed = 1e-4 + 1e-3
    assert check_bundle(path, "golden", run=run(0.9 * allowed)).passed
    assert not check_bundle(path, "golden", run=run(1.1 * allowed)).passed
    assert not check_bundle(path, "golden", run=run(float("nan"))).passed
    assert asked[0] == ("tiny", 100.0, (32, 48), "M")
    assert _states(check_bundle(path, "golden"))["golden"] == "skip"


def test_range_and_tiling_are_shown_on_noise_without_a_stored_input(tmp_path: Path) -> None:
    golden = _golden_with_output(np.zeros((3, 32, 48), np.float32))
    report = check_bundle(_write(tmp_path, tiny_manifest(), golden__safetensors=golden))
    states = _states(report)
    assert (states["tiling"], states["range"]) == ("pass", "pass")


def test_bundle_without_network_passes_with_skips(tmp_path: Path) -> None:
    update = {"networks": {}, "golden": (), "stages": tiny_manifest().stages[:3]}
    report = check_bundle(_write(tmp_path, tiny_manifest().model_copy(update=update)))
    assert report.passed
    assert list(_states(report).values()) == ["pass", "pass", *["skip"] * 4]


def _global_network() -> bytes:
    nodes = [
        helper.make_node("Conv", ["input", "w"], ["x"], "conv"),
        helper.make_node("GlobalAveragePool", ["x"], ["mean"], "mean"),
        helper.make_node("Mul", ["x", "mean"], ["output"], "gate"),
    ]
    return make_model(nodes, {"w": make_weight(3, 6, 1, 1)}).SerializeToString()


def test_network_that_sees_all_is_not_promised_to_tile(tmp_path: Path) -> None:
    facts = {
        "stride_px": 1,
        "receptive_field_radius_px": 0,
        "receptive_field_probe_px": 0,
        "global_operators": ("mean (GlobalAveragePool)",),
        "mac_per_pixel": 18.0,
        "bytes_per_pixel": 36.0,
        "parameters": 18,
        "max_activation": 9.0,
    }
    manifest = _with_facts(**facts).model_copy(update={"golden": ()})
    report = check_bundle(_write(tmp_path, manifest, network_m__onnx=_global_network()))
    assert report.passed
    assert "cannot be tiled (mean (GlobalAveragePool))" in _message(report, "tiling")


def test_tiled_and_whole_that_differ_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A halo one stride too short, as a wrong walk would give it.
    from camkit.runtime.proof import layers as proofs

    real = proofs.plan_windows

    def short(height_px: int, width_px: int, limits: proofs.TileLimits) -> proofs.TilePlan:
        return real(height_px, width_px, proofs.replace(limits, halo_px=0))

    monkeypatch.setattr(proofs, "plan_windows", short)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert "tiled differs from whole" in _message(report, "tiling")
    assert not report.passed


def test_probe_that_reaches_further_than_stated_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.runtime.network.probe import ProbedReach
    from camkit.runtime.proof import layers as proofs

    far = ProbedReach(radius_px=9, halo_px=9)
    monkeypatch.setattr(proofs, "perturbation_reach", lambda *_, **__: far)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert "acts 9 px far, the manifest says 3" in _message(report, "tiling")

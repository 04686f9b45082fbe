"""A good bundle proves itself; one that does not keep its word fails in the right layer."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import helper
from pydantic import ValidationError

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.golden import NO_SIZE, GoldenArrays, golden_from_bytes, golden_to_bytes
from camkit.bundle.manifest import GoldenCase, Manifest
from camkit.bundle.reader import GOLDEN, Bundle, open_bundle
from camkit.bundle.stages import Color, Linearise, Network
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.bundle.writer import write_bundle
from camkit.errors import CamkitError, ContractError
from camkit.runtime.machine.limits import BANK_WORK, PROOF_MB, PROOF_WORK, Limit
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.proof.check import LAYERS, CheckReport, check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import (
    make_model,
    make_weight,
    tiny_facts,
    tiny_golden,
    tiny_manifest,
    tiny_members,
    tiny_network,
    tiny_stages,
    write_tiny_bundle,
)
from tests.disk_watch import nothing_written
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle


def _write(folder: Path, manifest: Manifest, **members: bytes) -> Path:
    named = {name.replace("__", "."): data for name, data in members.items()}
    write_bundle(folder / "b.camkit", manifest, tiny_members() | named)
    return folder / "b.camkit"


def _with_facts(**change: Any) -> Manifest:
    facts = {DEFAULT_ROLE: {"M": tiny_facts().model_copy(update=change)}}
    return tiny_manifest().model_copy(update={"networks": facts})


def _golden(bundle: Bundle) -> bytes:
    """Give the golden cases of a bundle with what its pipeline makes of them now."""
    arrays = golden_from_bytes(bundle.member(GOLDEN))
    made = {}
    for case in bundle.manifest.golden:
        given = arrays[case.name]
        outputs: dict[str, dict[str, FloatArray]] = {}
        for size in bundle.manifest.sizes or (None,):
            for product in bundle.manifest.products:
                picture = case_work(bundle, case, given, size).fill(product=product)
                outputs.setdefault(product, {})[size or NO_SIZE] = picture
        reference = np.zeros_like(next(iter(outputs["image"].values())))
        made[case.name] = GoldenArrays(capture=given.capture, reference=reference, outputs=outputs)
    return golden_to_bytes(made)


def _proved(folder: Path) -> Path:
    """Write the tiny bundle with its golden outputs."""
    golden = _golden(open_bundle(write_tiny_bundle(folder)))
    return _write(folder, tiny_manifest(), golden__safetensors=golden)


def _states(report: CheckReport) -> dict[str, str]:
    return {layer.name: layer.status for layer in report.layers}


def _message(report: CheckReport, name: str) -> str:
    return next(layer.message for layer in report.layers if layer.name == name)


def test_good_bundle_passes_every_layer_without_touching_the_disk(tmp_path: Path) -> None:
    path = _proved(tmp_path)
    with nothing_written():
        report = check_bundle(path, run=case_work)
    assert _states(report) == dict.fromkeys(LAYERS, "pass") | {"laws": "skip"}, report.lines()
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
    report = check_bundle(_write(tmp_path, _with_facts(**change)), run=case_work)
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
    golden = open_bundle(_proved(tmp_path)).member(GOLDEN)
    other = tiny_network(seed=9)
    path = _write(tmp_path, tiny_manifest(), network_m__onnx=other, golden__safetensors=golden)
    report = check_bundle(path, run=case_work)
    assert _states(report)["golden"] == "fail"
    assert "differs from the stored result" in _message(report, "golden")


def test_golden_cases_of_other_names_fail(tmp_path: Path) -> None:
    manifest = tiny_manifest().model_copy(update={"golden": (GoldenCase(name="dark", iso=1),)})
    report = check_bundle(_write(tmp_path, manifest))
    assert "the manifest has the golden cases dark" in _message(report, "golden")


def _golden_with_output(output: FloatArray) -> bytes:
    case = tiny_golden()["typical"]
    outputs = {"image": {"M": output}}
    arrays = GoldenArrays(capture=case.capture, reference=case.reference, outputs=outputs)
    return golden_to_bytes({"typical": arrays})


def test_pipeline_is_run_on_the_capture_and_compared(tmp_path: Path) -> None:
    stored = np.full((3, 32, 48), 0.5, np.float32)
    path = _write(tmp_path, tiny_manifest(), golden__safetensors=_golden_with_output(stored))
    asked = []

    class Work:
        def __init__(self, error: float) -> None:
            self.error = error

        def shape_of(self, product: str) -> tuple[int, int, int]:
            assert product == "image"
            return 3, 32, 48

        def fill(self, out: FloatArray | None = None, product: str = "image") -> FloatArray:
            assert (out, product) == (None, "image")
            return stored + np.float32(self.error)

        def network_input(self, role: str) -> FloatArray:
            raise AssertionError(role)

    def run(error: float) -> Callable[[Bundle, GoldenCase, GoldenArrays, str | None], Work]:
        def pipeline(
            bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str | None
        ) -> Work:
            asked.append((bundle.manifest.name, case.iso, arrays.capture.shape, size))
            return Work(error)

        return pipeline

    allowed = 1e-4 + 1e-3
    assert check_bundle(path, "golden", run=run(0.9 * allowed)).passed
    assert not check_bundle(path, "golden", run=run(1.1 * allowed)).passed
    assert not check_bundle(path, "golden", run=run(float("nan"))).passed
    assert asked[0] == ("tiny", 100.0, (32, 48), "M")
    assert _states(check_bundle(path, "golden"))["golden"] == "skip"


def test_a_result_of_another_size_than_stored_fails(tmp_path: Path) -> None:
    golden = golden_from_bytes(open_bundle(_proved(tmp_path)).member(GOLDEN))["typical"]
    small = np.zeros((3, 30, 48), np.float32)
    other = GoldenArrays(capture=golden.capture, reference=small, outputs={"image": {"M": small}})
    path = _write(
        tmp_path, tiny_manifest(), golden__safetensors=golden_to_bytes({"typical": other})
    )
    message = _message(check_bundle(path, "golden", run=case_work), "golden")
    assert "computed (3, 32, 48), stored (3, 30, 48)" in message


def test_range_and_tiling_are_shown_on_noise_without_a_pipeline(tmp_path: Path) -> None:
    states = _states(check_bundle(write_tiny_bundle(tmp_path)))
    assert states == dict.fromkeys(LAYERS, "pass") | {"golden": "skip", "laws": "skip"}


def test_golden_cases_without_outputs_prove_nothing(tmp_path: Path) -> None:
    report = check_bundle(write_tiny_bundle(tmp_path), "golden", run=case_work)
    assert _states(report)["golden"] == "skip"
    assert _message(report, "golden") == "nothing to compare: no output is stored"


def test_bundle_without_network_passes_with_skips(tmp_path: Path) -> None:
    manifest = tiny_manifest(networks={}, golden=(), stages=tiny_stages("network"))
    report = check_bundle(_write(tmp_path, manifest))
    assert report.passed
    assert list(_states(report).values()) == ["pass", "pass", *["skip"] * 5]


def test_golden_cases_of_a_camera_without_networks_are_run_too(tmp_path: Path) -> None:
    members = tiny_members()
    del members["network_m.onnx"]
    manifest = tiny_manifest(networks={}, stages=tiny_stages("network"))
    write_bundle(tmp_path / "bank.camkit", manifest, members)
    golden = _golden(open_bundle(tmp_path / "bank.camkit"))
    write_bundle(tmp_path / "bank.camkit", manifest, members | {GOLDEN: golden})
    report = check_bundle(tmp_path / "bank.camkit", "golden", run=case_work)
    assert _states(report)["golden"] == "pass"
    assert "1 results" in _message(report, "golden")


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
    from camkit.runtime.device import tile_windows as proofs

    real = proofs.lay_windows

    def short(height_px: int, width_px: int, limits: proofs.TileLimits) -> proofs.TileLayout:
        return real(height_px, width_px, proofs.replace(limits, halo_px=0))

    monkeypatch.setattr(proofs, "lay_windows", short)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert "tiled differs from whole" in _message(report, "tiling")
    assert not report.passed


def test_a_network_that_is_exact_with_large_tiles_alone_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As matrix products do, whose sums depend on the width of the window.
    from camkit.runtime.proof import layers as proofs

    class Narrow(proofs.NetworkEngine):
        def run(self, window: FloatArray, out: FloatArray | None = None) -> FloatArray:
            made = super().run(window, out)
            return made if window.shape[3] > 40 else made + np.float32(1e-6)

    monkeypatch.setattr(proofs, "NetworkEngine", Narrow)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert "with windows of 10x10 px and a halo of 4 px" in _message(report, "tiling")
    assert not report.passed


@pytest.mark.parametrize(("stride", "tiles"), [(1, (1, 41, 64)), (16, (16, 48, 64))])
def test_tiles_lie_on_every_phase_of_the_lattice(stride: int, tiles: tuple[int, ...]) -> None:
    from camkit.runtime.device.tile_windows import tiles_px

    assert tiles_px(stride) == tiles
    for any_stride in range(1, 257):
        sides = tiles_px(any_stride)
        assert len(set(sides)) == 3
        assert any_stride in sides
        assert not any(side % any_stride for side in sides)


@pytest.mark.parametrize("limit", [PROOF_MB, PROOF_WORK])
def test_a_proof_that_would_take_too_much_is_refused_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: Limit
) -> None:
    path = _write(tmp_path, _with_facts(receptive_field_radius_px=4096))
    message = _message(check_bundle(path, "tiling"), "tiling")
    assert f"set {PROOF_MB.variable}=" in message
    sound = write_tiny_bundle(tmp_path)
    monkeypatch.setenv(limit.variable, "0.001")
    message = _message(check_bundle(sound, "tiling"), "tiling")
    assert f"{limit.variable}=" in message


def test_out_of_memory_fails_its_layer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from camkit.runtime.proof import layers as proofs

    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(proofs, "perturbation_reach", full)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert _message(report, "tiling").startswith("out of memory")
    assert not report.passed


@pytest.mark.parametrize("name", ["receptive_field_radius_px", "receptive_field_probe_px"])
def test_a_reach_beyond_any_network_breaks_the_schema(name: str) -> None:
    document = tiny_facts().model_dump(mode="json")
    NetworkFacts.model_validate(document | {name: 4096})
    with pytest.raises(ValidationError, match=name):
        NetworkFacts.model_validate(document | {name: 10**12})


@pytest.mark.parametrize("name", ["atol", "rtol"])
def test_a_tolerance_that_proves_nothing_breaks_the_schema(name: str) -> None:
    GoldenCase.model_validate({"name": "a", "iso": 100, name: 0.01})
    with pytest.raises(ValidationError, match=name):
        GoldenCase.model_validate({"name": "a", "iso": 100, name: 1e308})


ODD_CAPTURES = {
    "one sample": (1, 1),
    "one row": (1, 48),
    "one column": (48, 1),
    "odd": (7, 9),
    "three axes": (3, 32, 48),
    "one of three axes": (1, 32, 48),
    "a thousand planes": (1000, 1, 1),
}


@pytest.mark.parametrize("shape", ODD_CAPTURES.values(), ids=ODD_CAPTURES.keys())
@pytest.mark.parametrize("level", ["golden", "tiling", "range"])
def test_golden_cases_of_odd_shapes_pass_or_fail_in_their_layer(
    tmp_path: Path, shape: tuple[int, ...], level: str
) -> None:
    capture = np.full(shape, 500, np.uint16)
    picture = np.zeros((3, *shape[-2:]), np.float32)
    arrays = GoldenArrays(capture=capture, reference=picture, outputs={"image": {"M": picture}})
    golden = golden_to_bytes({"typical": arrays})
    report = check_bundle(
        _write(tmp_path, tiny_manifest(), golden__safetensors=golden), level, run=case_work
    )
    assert _states(report)[level] in ("pass", "fail")


@pytest.mark.parametrize("level", ["tiling", "range"])
def test_golden_cases_of_other_names_fail_wherever_they_are_used(
    tmp_path: Path, level: str
) -> None:
    manifest = tiny_manifest().model_copy(update={"golden": (GoldenCase(name="dark", iso=1),)})
    report = check_bundle(_write(tmp_path, manifest), level, run=case_work)
    assert "the manifest has the golden cases dark" in _message(report, level)


def test_a_product_finer_than_memory_holds_is_not_computed(tmp_path: Path) -> None:
    class Work:
        def shape_of(self, product: str) -> tuple[int, int, int]:
            return 3, 2**20, 2**20

        def fill(self, out: FloatArray | None = None, product: str = "image") -> FloatArray:
            raise AssertionError(product)

        def network_input(self, role: str) -> FloatArray:
            raise AssertionError(role)

    message = _message(check_bundle(_proved(tmp_path), "golden", run=lambda *_: Work()), "golden")
    assert "computed (3, 1048576, 1048576), stored (3, 32, 48)" in message


def test_a_kind_that_is_not_installed_fails_the_schema(tmp_path: Path) -> None:
    manifest = tiny_manifest(kind="dream")
    report = check_bundle(_write(tmp_path, manifest), "schema")
    assert not report.passed
    assert "there is no kind of camera 'dream' here" in _message(report, "schema")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"block_px": 8192}, "blocks of 8192 px, which take .* raise max_mem_bytes"),
        ({"clip_iterations": 100, "overlap_px": 16}, BANK_WORK.variable),
    ],
)
def test_a_bank_that_asks_too_much_fails_the_schema_and_is_not_loaded(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    stages = tuple(
        stage.model_copy(update=change) if stage.type == "wiener" else stage
        for stage in tiny_stages()
    )
    path = _write(tmp_path, tiny_manifest(stages=stages))
    report = check_bundle(path, "schema")
    assert re.search(message, _message(report, "schema"))
    with pytest.raises(CamkitError, match=message):
        Pipeline(open_bundle(path), Options())


def test_probe_that_reaches_further_than_stated_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from camkit.runtime.network.probe import ProbedReach
    from camkit.runtime.proof import layers as proofs

    far = ProbedReach(radius_px=9, halo_px=9)
    monkeypatch.setattr(proofs, "perturbation_reach", lambda *_, **__: far)
    report = check_bundle(write_tiny_bundle(tmp_path), "tiling")
    assert "acts 9 px far, the manifest says 3" in _message(report, "tiling")


# ------------------------------------------------------------------------------- other cameras


def _write_enlarging(folder: Path, golden: bytes | None = None, **changes: Any) -> Bundle:
    """Write a camera of one channel, two networks in a row and an output of twice the size."""
    graphs = {
        "clean": finer_network(1, 1, scale=1, seed=1),
        "enlarge": finer_network(2, 2, scale=2, seed=2),
    }
    one, two = Port(name="a", channels=1), Port(name="b", channels=1)
    fine = [port.model_copy(update={"scale": 2}) for port in (one, two)]
    facts = {
        "clean": facts_of(graphs["clean"], [one], [one], "clean.onnx"),
        "enlarge": facts_of(graphs["enlarge"], [one, two], fine, "enlarge.onnx"),
    }
    facts = {role: entry.model_copy(update=changes) for role, entry in facts.items()}
    stages = (
        Linearise(gives=("light",)),
        Network(role="clean", takes=("light",), gives=("calm",)),
        Network(role="enlarge", takes=("light", "calm"), gives=("large", "far")),
        Color(takes=("large",)),
    )
    rng = np.random.default_rng(3)
    case = GoldenArrays(
        capture=rng.integers(64, 900, (1, 32, 48), dtype=np.uint16),
        reference=np.zeros((3, 64, 96), np.float32),
    )
    return write_planes_bundle(
        folder,
        stages,
        sensor=planes_sensor(),
        networks={role: (facts[role], graphs[role]) for role in graphs},
        products={"image": "picture", "depth": "far"},
        members={GOLDEN: golden or golden_to_bytes({"typical": case})},
        golden=(GoldenCase(name="typical", iso=100),),
    )


def test_a_camera_of_two_networks_and_a_finer_output_passes_every_layer(tmp_path: Path) -> None:
    golden = _golden(_write_enlarging(tmp_path))
    stored = golden_from_bytes(golden)["typical"]
    assert stored.output("image", "M").shape == (3, 64, 96)  # type: ignore[union-attr]
    assert stored.output("depth", "M").shape == (1, 64, 96)  # type: ignore[union-attr]
    bundle = _write_enlarging(tmp_path, golden)
    with nothing_written():
        report = check_bundle(bundle.path, run=case_work)
    assert _states(report) == dict.fromkeys(LAYERS, "pass") | {"laws": "skip"}, report.lines()
    assert "2 results" in _message(report, "golden")
    for role in ("clean", "enlarge"):
        assert f"M ({role})" in _message(report, "tiling")
        assert f"M ({role})" in _message(report, "range")


@pytest.mark.parametrize(
    ("change", "layer", "message"),
    [
        ({"receptive_field_radius_px": 1, "receptive_field_probe_px": 0}, "graph", "reaches 3 px"),
        ({"stride_px": 4}, "graph", "stride"),
        ({"max_activation": 1e-3}, "range", "the manifest says 0.001"),
    ],
)
def test_false_facts_of_finer_networks_fail_in_their_layer(
    tmp_path: Path, change: dict[str, Any], layer: str, message: str
) -> None:
    bundle = _write_enlarging(tmp_path, **change)
    report = check_bundle(bundle.path, run=case_work)
    assert _states(report)[layer] == "fail"
    assert message in _message(report, layer)


def test_a_false_scale_fails_the_graph(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    port = Port(name="a", channels=1)
    facts = facts_of(data, [port], [port])
    stages = (Linearise(gives=("light",)), Network(takes=("light",), gives=("large",)))
    bundle = write_planes_bundle(
        tmp_path, stages, sensor=planes_sensor(), networks={"restore": (facts, data)}
    )
    message = _message(check_bundle(bundle.path, "graph"), "graph")
    assert "output scale of the graph is 2, the manifest says 1" in message

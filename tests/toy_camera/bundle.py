"""A small bundle of the toy camera without training: graphs of a few nodes, one golden case."""

from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.golden import IMAGE, GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase, Manifest, planes_of
from camkit.bundle.optics import FrozenPsfOptics
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import ChannelResponse, Extent, IsoNoise, PlanesSensor
from camkit.bundle.stages import Color, Linearise, Network, Parts, Repair
from camkit.bundle.writer import write_bundle
from camkit.psf import FrozenPsf
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.ranges import node_activations
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.runtime.twin.truth import ideal_picture
from camkit.scenes import procedural_scene
from tests.psf_factory import PITCH_UM, grid_psf, streak_kernel

WIDTH_PX, HEIGHT_PX = 192, 160
GOLDEN_PX = 64
SCALE = 2
CASE = GoldenCase(name="typical", iso=400, origin_px=(40, 24), recipe={"seed": 3})
STAGES = (
    Linearise(),
    Repair(),
    Network(role="denoise", takes=("sound",), gives=("quiet",), scale=64.0),
    Network(role="upscale", takes=("quiet",), gives=("fine",), transform="none"),
    Color(takes=("fine",)),
)


def toy_network(scale: int, strength: float) -> bytes:
    """Build (1, 1, h, w) -> (1, 1, s h, s w): the input repeated, and a little of its detail."""
    cells = scale**2
    rng = np.random.default_rng(scale)
    weights: dict[str, NDArray[np.float32]] = {
        "head.weight": rng.standard_normal((8, 1, 6, 6)).astype(np.float32) / 6,
        "tail.weight": np.float32(strength)
        * rng.standard_normal((4 * cells, 8, 3, 3)).astype(np.float32),
    }
    head = {"strides": [2, 2], "pads": [2, 2, 2, 2]}
    nodes = [
        helper.make_node("Conv", ["input", "head.weight"], ["head"], "head", **head),
        helper.make_node("LeakyRelu", ["head"], ["active"], "active", alpha=0.1),
        helper.make_node("Conv", ["active", "tail.weight"], ["tail"], "tail", pads=[1, 1, 1, 1]),
        _shuffled("tail", "detail", 2 * scale),
    ]
    if scale > 1:
        repeated = ["input"] * cells
        nodes += [
            helper.make_node("Concat", repeated, ["repeated"], "repeated", axis=1),
            _shuffled("repeated", "large", scale),
        ]
    large = "large" if scale > 1 else "input"
    nodes.append(helper.make_node("Add", ["detail", large], ["output"], "sum"))
    sides = ["height", "width"]
    graph = helper.make_graph(
        nodes,
        "toy",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, [1, 1, *sides])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, 1, "rows", "columns"])],
        [numpy_helper.from_array(values, name) for name, values in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    return bytes(model.SerializeToString(deterministic=True))


def _shuffled(source: str, name: str, block: int) -> onnx.NodeProto:
    return helper.make_node("DepthToSpace", [source], [name], name, blocksize=block, mode="CRD")


def toy_facts(member: str, model: bytes, scale: int, most: float) -> NetworkFacts:
    """Give the facts that follow from a graph, and its largest activation."""
    found = inspect_graph(model)
    return NetworkFacts(
        member=member,
        inputs=(Port(name="planes", channels=1),),
        outputs=(Port(name="planes", channels=1, scale=scale),),
        receptive_field_radius_px=found.receptive_field_radius_px,
        receptive_field_probe_px=found.receptive_field_radius_px,
        stride_px=found.stride_px,
        max_activation=most,
        fp16_safe=False,
        mac_per_pixel=found.mac_per_pixel,
        bytes_per_pixel=found.bytes_per_pixel,
        parity_max_abs=0.0,
        parameters=found.parameters,
    )


def toy_psf() -> FrozenPsf:
    """Give one-sided streaks that differ over the field."""
    kernels = np.array([[streak_kernel(25.0, n) for n in row] for row in ((3, 4), (5, 6))])
    half_mm = np.array([WIDTH_PX, HEIGHT_PX]) * PITCH_UM / 2000
    x_mm, y_mm = (np.array([-side, side]) for side in half_mm)
    return grid_psf(kernels, x_mm, y_mm, (0.5, 0.6))


def toy_manifest(most: float = 100.0, **changes: object) -> tuple[Manifest, dict[str, bytes]]:
    """Give a manifest with its members, apart from golden cases."""
    sensor = PlanesSensor(
        extent=Extent(width_px=WIDTH_PX, height_px=HEIGHT_PX, pixel_pitch_um=PITCH_UM),
        channels=("Y",),
        black_level=64,
        white_level=4095,
        full_well_e=9000,
        noise=(IsoNoise(iso=100, gain_e_per_dn=2.2, read_noise_e=3.0),),
        channel_response=ChannelResponse(
            wavelengths_um=(0.5, 0.6), response=((1.0, 0.8),), source="made up for tests"
        ),
    )
    models = {"denoise": (toy_network(1, 0.002), 1), "upscale": (toy_network(SCALE, 0.002), SCALE)}
    networks = {
        role: {"S": toy_facts(f"{role}_s.onnx", model, scale, most)}
        for role, (model, scale) in models.items()
    }
    psf = toy_psf()
    parts = Parts(
        sensor=sensor,
        optics=FrozenPsfOptics(pixel_pitch_um=PITCH_UM, symmetry=psf.symmetry),
        networks=networks,
    )
    fields: dict[str, object] = {
        "kind": "toy",
        "name": "toy",
        "version": "1.0.0",
        "licence": "Apache-2.0",
        "training_data": "none",
        "sensor": parts.sensor,
        "optics": parts.optics,
        "networks": networks,
        "stages": STAGES,
        "planes": planes_of(STAGES, parts),
        "products": {IMAGE: STAGES[-1].gives[0]},
        "exported_with": {"camkit": "0.1.0"},
    }
    members = {f"{role}_s.onnx": model for role, (model, _) in models.items()}
    members["psf.safetensors"] = psf_to_bytes(psf)
    return Manifest.model_validate(fields | changes), members


def write_toy_bundle(folder: Path) -> Bundle:
    """Write a bundle that proves itself: first without its golden case, then with what it gave."""
    path = folder / "toy.camkit"
    manifest, members = toy_manifest()
    write_bundle(path, manifest, members)
    bare = open_bundle(path)
    side = SCALE * GOLDEN_PX
    simulation = simulate(
        procedural_scene(3, side, side),
        bare.manifest.sensor,
        bare.psf,
        SimulationOptions(iso=CASE.iso, seed=3, origin_px=CASE.origin_px, scale=SCALE),
    )
    truth = GoldenArrays(
        capture=simulation.samples, reference=ideal_picture(simulation, bare), outputs={}
    )
    work = case_work(bare, CASE, truth, "S")
    made = {IMAGE: {"S": work.fill()}}
    found = [
        node_activations(bare.network_bytes(role, "S"), [work.network_input(role)[None]])
        for role in bare.manifest.networks
    ]
    most = max(max(activations.values()) for activations in found)
    golden = GoldenArrays(capture=truth.capture, reference=truth.reference, outputs=made)
    manifest, members = toy_manifest(most, golden=(CASE,))
    members["golden.safetensors"] = golden_to_bytes({CASE.name: golden})
    write_bundle(path, manifest, members)
    return open_bundle(path)

"""The tiny camera without its Wiener bank, or without its network."""

from pathlib import Path
from typing import Any

import numpy as np
from onnx import helper

from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.runtime.network.graph import inspect_graph
from tests.bundle_factory import make_model, tiny_manifest, tiny_members, tiny_sensor, tiny_stages

SIZES = ("quick", "thorough")


def _network(width: int) -> bytes:
    """Build (1, 3, h, w) -> (1, 3, h, w): the input and a hundredth of what it sees around it."""
    rng = np.random.default_rng(width)
    weights = {
        "head.weight": rng.standard_normal((width, 3, 3, 3)).astype(np.float32) / 5,
        "tail.weight": rng.standard_normal((3, width, 3, 3)).astype(np.float32) / 500,
    }
    nodes = [
        helper.make_node("Conv", ["input", "head.weight"], ["head"], "head", pads=[1, 1, 1, 1]),
        helper.make_node("LeakyRelu", ["head"], ["active"], "active", alpha=0.1),
        helper.make_node("Conv", ["active", "tail.weight"], ["tail"], "tail", pads=[1, 1, 1, 1]),
        helper.make_node("Add", ["tail", "input"], ["output"], "sum"),
    ]
    model = make_model(nodes, weights, channels=(3, 3))
    return bytes(model.SerializeToString(deterministic=True))


def write_bankless_bundle(folder: Path) -> Bundle:
    """Write a camera whose networks, of sizes of its own names, work on the colours alone."""
    models = {size: _network(4 * (i + 1)) for i, size in enumerate(SIZES)}
    facts = {}
    for size, model in models.items():
        found = inspect_graph(model)
        facts[size] = NetworkFacts(
            member=f"{size}.onnx",
            inputs=(Port(name="colours", channels=3),),
            outputs=(Port(name="clean", channels=3),),
            receptive_field_radius_px=found.receptive_field_radius_px,
            receptive_field_probe_px=found.receptive_field_radius_px,
            stride_px=found.stride_px,
            max_activation=100.0,
            fp16_safe=False,
            mac_per_pixel=found.mac_per_pixel,
            bytes_per_pixel=found.bytes_per_pixel,
            parity_max_abs=0.0,
            parameters=found.parameters,
        )
    members = {f"{size}.onnx": model for size, model in models.items()}
    stages = tuple(
        stage.model_copy(update={"takes": ("rgb",)}) if stage.type == "network" else stage
        for stage in tiny_stages("wiener")
    )
    return _write(folder, members, name="bankless", stages=stages, networks={"restore": facts})


def write_networkless_bundle(folder: Path) -> Bundle:
    """Write a camera that has the bank alone."""
    return _write(folder, {}, name="networkless", stages=tiny_stages("network"), networks={})


def _write(folder: Path, models: dict[str, bytes], **changes: Any) -> Bundle:
    members = {"psf.safetensors": tiny_members()["psf.safetensors"]} | models
    path = folder / f"{changes['name']}.camkit"
    manifest = tiny_manifest(sensor=tiny_sensor(320, 240), golden=(), **changes)
    write_bundle(path, manifest, members)
    return open_bundle(path)

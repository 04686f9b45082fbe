"""The tiny camera with networks as people have them, and a sensor of another size."""

from pathlib import Path

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.writer import write_bundle
from camkit.runtime.network.graph import inspect_graph
from tests.bundle_factory import (
    tiny_facts,
    tiny_manifest,
    tiny_members,
    tiny_sensor,
    tiny_stages,
)

SIZE_PX = 2400, 1600


def write_network_bundle(
    folder: Path, models: dict[str, bytes], size_px: tuple[int, int] = SIZE_PX
) -> Path:
    """Write the tiny camera with another sensor and networks, by size, with facts of the graphs."""
    facts, graphs = {}, {}
    for size, data in models.items():
        member = f"network_{size.lower()}.onnx"
        facts[size], graphs[member] = _facts(member, data), data
    manifest = tiny_manifest(
        sensor=tiny_sensor(*size_px),
        stages=tiny_stages("undistort", "illumination"),
        networks={"restore": facts},
        golden=(),
    )
    members = tiny_members() | graphs
    del members["golden.safetensors"]
    path = folder / "foreign.camkit"
    write_bundle(path, manifest, members)
    return path


def _facts(member: str, data: bytes) -> NetworkFacts:
    found = inspect_graph(data)
    names = ("stride_px", "receptive_field_radius_px", "global_operators", "mac_per_pixel")
    return tiny_facts().model_copy(
        update={name: getattr(found, name) for name in (*names, "bytes_per_pixel", "parameters")}
        | {"receptive_field_probe_px": 0, "max_activation": 1e9, "fp16_safe": False}
        | {"member": member}
    )

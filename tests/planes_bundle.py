"""Cameras of planes: any number of channels, any PSF, networks of any ports and scale, any size.

The network of `finer_model` is that of `tests.bundle_factory` without its residual: a stride-2 head
convolution, a residual step, a 1x1 convolution and DepthToSpace, which gives `scale` times as many
samples along a side.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import helper

from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.optics import PSF, FrozenPsfOptics
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import ChannelResponse, Extent, IsoNoise, PlanesSensor
from camkit.bundle.stages import Parts, Stage
from camkit.bundle.writer import write_bundle
from camkit.psf import FrozenPsf
from camkit.runtime.network.graph import inspect_graph
from tests.bundle_factory import PITCH_UM, make_model, make_weight

STRIDE_PX = 2
SIZE_PX = (96, 64)


def finer_model(
    channels: int = 6, outputs: int = 3, *, scale: int = 2, seed: int = 0
) -> onnx.ModelProto:
    """Build the network described at the head of the module."""
    block = STRIDE_PX * scale
    weights = {
        "head.weight": make_weight(8, channels, 4, 4, seed=seed),
        "body.weight": np.float32(0.2) * make_weight(8, 8, 3, 3, seed=seed + 1),
        "tail.weight": make_weight(outputs * block * block, 8, 1, 1, seed=seed + 2),
    }
    nodes = [
        helper.make_node(
            "Conv", ["input", "head.weight"], ["head"], "head", strides=[2, 2], pads=[1, 1, 1, 1]
        ),
        helper.make_node("LeakyRelu", ["head"], ["active"], "active", alpha=0.1),
        helper.make_node("Conv", ["active", "body.weight"], ["body"], "body", pads=[1, 1, 1, 1]),
        helper.make_node("Add", ["body", "active"], ["sum"], "sum"),
        helper.make_node("Conv", ["sum", "tail.weight"], ["tail"], "tail"),
        helper.make_node("DepthToSpace", ["tail"], ["output"], "fine", blocksize=block, mode="CRD"),
    ]
    return make_model(nodes, weights, channels=(channels, outputs))


def finer_network(channels: int = 6, outputs: int = 3, *, scale: int = 2, seed: int = 0) -> bytes:
    """Give the network as bytes."""
    model = finer_model(channels, outputs, scale=scale, seed=seed)
    return model.SerializeToString(deterministic=True)


def facts_of(
    data: bytes, inputs: Sequence[Port], outputs: Sequence[Port], member: str = "network_m.onnx"
) -> NetworkFacts:
    """Give what a manifest says of a network, read from its graph."""
    found = inspect_graph(data)
    return NetworkFacts(
        member=member,
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        receptive_field_radius_px=found.receptive_field_radius_px,
        receptive_field_probe_px=found.receptive_field_radius_px,
        stride_px=found.stride_px,
        max_activation=1e3,
        fp16_safe=True,
        mac_per_pixel=found.mac_per_pixel,
        bytes_per_pixel=found.bytes_per_pixel,
        parity_max_abs=0.0,
        parameters=found.parameters,
    )


def planes_sensor(
    channels: tuple[str, ...] = ("Y",),
    size_px: tuple[int, int] | None = SIZE_PX,
    **changes: Any,
) -> PlanesSensor:
    """Give a sensor of planes; without a size it takes pictures of any."""
    extent = None
    if size_px is not None:
        extent = Extent(width_px=size_px[0], height_px=size_px[1], pixel_pitch_um=PITCH_UM)
    wavelengths_um = np.linspace(0.45, 0.65, max(len(channels), 2))
    response = 0.1 + np.eye(wavelengths_um.size)[: len(channels)]
    fields: dict[str, Any] = {
        "extent": extent,
        "channels": channels,
        "black_level": 64,
        "white_level": 1023,
        "full_well_e": 10_000,
        "noise": (IsoNoise(iso=100, gain_e_per_dn=10.0, read_noise_e=4.0),),
        "channel_response": ChannelResponse(
            wavelengths_um=tuple(wavelengths_um),
            response=tuple(map(tuple, response)),
            source="made up for tests",
        ),
    }
    return PlanesSensor(**(fields | changes))


def write_planes_bundle(
    folder: Path,
    stages: tuple[Stage, ...],
    *,
    sensor: PlanesSensor | None = None,
    psf: FrozenPsf | None = None,
    networks: dict[str, tuple[NetworkFacts, bytes]] | None = None,
    products: dict[str, str] | None = None,
    members: dict[str, bytes] | None = None,
    name: str = "planes.camkit",
    **changes: Any,
) -> Bundle:
    """Write and open a camera of planes.

    Args:
        folder: Where to.
        stages: What it does.
        sensor: One channel unless given.
        psf: Its optics, if any.
        networks: Role -> facts and graph of its one size.
        products: What comes out; the first plane of the last stage as `image` unless given.
        members: More of them.
        name: Of the file.
        **changes: Other fields of the manifest.
    """
    given = networks or {}
    parts = Parts(
        sensor=sensor or planes_sensor(),
        optics=None
        if psf is None
        else FrozenPsfOptics(pixel_pitch_um=psf.pixel_pitch_um, symmetry=psf.symmetry),
        networks={role: {"M": facts} for role, (facts, _) in given.items()},
    )
    fields: dict[str, Any] = {
        "name": "planes",
        "version": "1.0.0",
        "licence": "Apache-2.0",
        "training_data": "untrained",
        "sensor": parts.sensor,
        "optics": parts.optics,
        "stages": stages,
        "planes": planes_of(stages, parts),
        "products": products or {"image": stages[-1].gives[0]},
        "networks": parts.networks,
    }
    files = {facts.member: data for facts, data in given.values()} | (members or {})
    if psf is not None:
        files[PSF] = psf_to_bytes(psf)
    path = folder / name
    write_bundle(path, Manifest(**(fields | changes)), files)
    return open_bundle(path)

"""A small bundle of single photons without training: 24x16 pixels, a network of a few layers."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.golden import IMAGE
from camkit.bundle.manifest import Manifest, planes_of
from camkit.bundle.optics import FrozenPsfOptics
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import Extent, SpadSensor
from camkit.bundle.stages import Correct, Parts, Sharpen, SuperResolve
from camkit.bundle.writer import write_bundle
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.kinds.spad.networks import build_spad_network
from camkit.models_def.kinds.spad.plate_psf import frozen_psf
from camkit.models_def.kinds.spad.sampling import gaussian_psf
from camkit.runtime.network.graph import inspect_graph

HEIGHT, WIDTH, SCALE, PHASE = 16, 24, 4, 2
BINS = 80
TIMES = Sharpen(gate_width_ps=200, gate_rc_ps=60, jitter_ps=42.5)
LEAN = np.linspace(0.5, 1.5, 11)


def leaning_kernel() -> np.ndarray:
    """Give a kernel that is another one when it is turned about."""
    kernel = gaussian_psf(1.6) * np.outer(LEAN, LEAN**2)
    return np.asarray(kernel / kernel.sum(), np.float32)


@cache
def _model() -> bytes:
    """Return the graph, traced once in a process."""
    torch.manual_seed(1)
    network = build_spad_network("sub_pixel_s", width=16, blocks=1)
    return to_onnx(network, channels=2, scale=SCALE)


def write_spad_bundle(folder: Path, **changes: Any) -> Bundle:
    """Write the bundle; its network is bicubic interpolation until it is trained."""
    model = _model()
    found = inspect_graph(model)
    facts = NetworkFacts(
        member="upscale_s.onnx",
        inputs=(Port(name="light", channels=1), Port(name="noise", channels=1)),
        outputs=(Port(name="fine", channels=1, scale=SCALE),),
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
    psf = frozen_psf(leaning_kernel())
    sensor = SpadSensor(
        extent=Extent(width_px=WIDTH, height_px=HEIGHT, pixel_pitch_um=150.0),
        time_bins=BINS,
        time_bin_ps=20.0,
        sub_pixels=SCALE,
        phase=PHASE,
    )
    parts = Parts(
        sensor=sensor,
        optics=FrozenPsfOptics(pixel_pitch_um=psf.pixel_pitch_um, symmetry=psf.symmetry),
        networks={"upscale": {"S": facts}},
    )
    stages = (Correct(), SuperResolve(), TIMES)
    fields: dict[str, Any] = {
        "kind": "spad",
        "name": "tiny-spad",
        "version": "1.0.0",
        "licence": "Apache-2.0",
        "training_data": "none",
        "sensor": parts.sensor,
        "optics": parts.optics,
        "networks": parts.networks,
        "stages": stages,
        "planes": planes_of(stages, parts),
        "products": {IMAGE: "fine", "depth_m": "depth"},
        "exported_with": {"camkit": "0.1.0"},
    }
    members = {"upscale_s.onnx": model, "psf.safetensors": psf_to_bytes(psf)}
    path = folder / "tiny-spad.camkit"
    write_bundle(path, Manifest.model_validate(fields | changes), members)
    return open_bundle(path)

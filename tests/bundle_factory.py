"""A tiny valid bundle, and the tiny networks in it: a start for tests that need one.

The network of `tiny_network` is the smallest of the kind that camkit ships: a stride-2 head
convolution, a residual step, a 1x1 convolution with DepthToSpace and the residual on the Wiener
planes. It has 6 channels in, 3 out, a stride of 2, and tiles of it need a halo of 3.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from camkit.bundle.chain import rewired
from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.golden import GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase, Manifest, planes_of
from camkit.bundle.optics import FrozenPsfOptics
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.sensor import BayerSensor, ChannelResponse, Extent, IsoNoise
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Illumination,
    Linearise,
    Network,
    Parts,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.bundle.writer import write_bundle
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion

PITCH_UM = 6.0
RNG = np.random.default_rng


def make_model(
    nodes: Sequence[onnx.NodeProto],
    weights: dict[str, NDArray[np.generic]],
    *,
    channels: tuple[int, int] = (6, 3),
    opset: int = 18,
    ir: int = 10,
) -> onnx.ModelProto:
    """Build a model from "input" to "output" around some nodes."""
    sides = ["height", "width"]
    graph = helper.make_graph(
        list(nodes),
        "tiny",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, [1, channels[0], *sides])],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, channels[1], *sides])],
        [numpy_helper.from_array(np.ascontiguousarray(w), name) for name, w in weights.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=ir)


def make_weight(*shape: int, seed: int = 0) -> NDArray[np.float32]:
    """Give positive weights whose sums are about 1, so that no path is ever dead."""
    values = RNG(seed).uniform(0.5, 1.5, shape)
    return (values / np.prod(shape[1:])).astype(np.float32)


def tiny_model(*, seed: int = 0, scale: float = 1.0) -> onnx.ModelProto:
    """Build the network described at the head of the module; `scale` multiplies its head."""
    weights = {
        "head.weight": np.float32(scale) * make_weight(8, 6, 4, 4, seed=seed),
        "body.weight": make_weight(8, 8, 3, 3, seed=seed + 1),
        "tail.weight": np.float32(0.1) * make_weight(12, 8, 1, 1, seed=seed + 2),
        "starts": np.array([3], dtype=np.int64),
        "ends": np.array([6], dtype=np.int64),
        "axes": np.array([1], dtype=np.int64),
    }
    nodes = [
        helper.make_node(
            "Conv", ["input", "head.weight"], ["head"], "head", strides=[2, 2], pads=[1, 1, 1, 1]
        ),
        helper.make_node("LeakyRelu", ["head"], ["active"], "active", alpha=0.1),
        helper.make_node("Conv", ["active", "body.weight"], ["body"], "body", pads=[1, 1, 1, 1]),
        helper.make_node("Add", ["body", "active"], ["sum"], "sum"),
        helper.make_node("Conv", ["sum", "tail.weight"], ["tail"], "tail"),
        helper.make_node("DepthToSpace", ["tail"], ["fine"], "fine", blocksize=2, mode="CRD"),
        helper.make_node("Slice", ["input", "starts", "ends", "axes"], ["wiener"], "wiener"),
        helper.make_node("Add", ["fine", "wiener"], ["output"], "residual"),
    ]
    return make_model(nodes, weights)


def tiny_network(*, seed: int = 0, scale: float = 1.0) -> bytes:
    """Give the tiny network as bytes."""
    return tiny_model(seed=seed, scale=scale).SerializeToString(deterministic=True)


def tiny_psf(*, pitch_um: float = PITCH_UM) -> FrozenPsf:
    """Give a PSF of two fields, one depth and three wavelengths on 5 x 5 samples."""
    kernels = RNG(5).uniform(0.1, 1.0, (2, 1, 3, 5, 5)).astype(np.float32)
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True)
    return FrozenPsf(
        kernels=kernels,
        field_heights_mm=np.array([0.0, 0.4]),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.45, 0.55, 0.62]),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(
            coefficients=np.tile([1.0, -0.01, 0.0, 0.0], (3, 1)), radius_mm=0.35
        ),
        relative_illumination=np.array([1.0, 0.8]),
    )


def tiny_sensor(width_px: int = 96, height_px: int = 64) -> BayerSensor:
    """Give a sensor of 96 x 64 pixels."""
    return BayerSensor(
        extent=Extent(width_px=width_px, height_px=height_px, pixel_pitch_um=PITCH_UM),
        cfa="RGGB",
        black_level=64,
        white_level=1023,
        full_well_e=10_000,
        noise=(
            IsoNoise(iso=100, gain_e_per_dn=10.0, read_noise_e=4.0),
            IsoNoise(iso=400, gain_e_per_dn=2.5, read_noise_e=3.0),
        ),
        channel_response=ChannelResponse(
            wavelengths_um=(0.45, 0.55, 0.62),
            response=((0.0, 0.1, 1.0), (0.1, 1.0, 0.1), (1.0, 0.1, 0.0)),
            source="made up for tests",
        ),
        color_matrix=((0.9, -0.2, -0.1), (-0.4, 1.2, 0.2), (-0.1, 0.2, 0.7)),
    )


def tiny_optics(**changes: Any) -> FrozenPsfOptics:
    """Give the optics of the tiny PSF."""
    return FrozenPsfOptics(**({"pixel_pitch_um": PITCH_UM} | changes))


def tiny_facts() -> NetworkFacts:
    """Give the facts of the tiny network (activations as measured on the golden case)."""
    return NetworkFacts(
        member="network_m.onnx",
        inputs=(Port(name="capture", channels=3), Port(name="wiener", channels=3)),
        outputs=(Port(name="clean", channels=3),),
        receptive_field_radius_px=3,
        receptive_field_probe_px=3,
        stride_px=2,
        max_activation=4.0,
        node_activation={},
        fp16_safe=True,
        mac_per_pixel=768 / 4 + 576 / 4 + 96 / 4,
        bytes_per_pixel=48.0,
        parity_max_abs=0.0,
        parameters=768 + 576 + 96,
    )


def tiny_stages(*left_out: str) -> tuple[Stage, ...]:
    """Give the usual stages, wired as if those left out (by type) were not there."""
    usual: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        WhiteBalance(),
        Demosaic(method="fast"),
        Wiener(block_px=32, overlap_px=8, prior_scale=1e-3, prior_exponent=2.0),
        Network(scale=64.0),
        RaiseClipped(),
        Illumination(),
        Undistort(),
        Color(),
    )
    return rewired([stage for stage in usual if stage.type not in left_out], usual)


def tiny_manifest(**changes: Any) -> Manifest:
    """Give a manifest of every stage, without members; planes and product follow the stages."""
    fields: dict[str, Any] = {
        "name": "tiny",
        "version": "1.0.0",
        "licence": "Apache-2.0",
        "training_data": "untrained",
        "sensor": tiny_sensor(),
        "optics": tiny_optics(),
        "stages": tiny_stages(),
        "networks": {DEFAULT_ROLE: {"M": tiny_facts()}},
        "golden": (GoldenCase(name="typical", iso=100, recipe={"scene": "noise", "seed": 3}),),
        "exported_with": {"camkit": "0.1.0"},
    } | changes
    parts = Parts(**{name: fields[name] for name in ("sensor", "optics", "networks")})
    stages = fields["stages"]
    joined = {"planes": planes_of(stages, parts), "products": {"image": stages[-1].gives[0]}}
    return Manifest(**(joined | fields))


def tiny_golden() -> dict[str, GoldenArrays]:
    """Give one golden case of 32 x 48 pixels, without outputs."""
    rng = RNG(3)
    return {
        "typical": GoldenArrays(
            capture=rng.integers(64, 1024, (32, 48), dtype=np.uint16),
            reference=rng.random((3, 32, 48), dtype=np.float32).astype(np.float16).astype("f4"),
        )
    }


def tiny_forward(planes: NDArray[np.float32], *, seed: int = 0) -> NDArray[np.float32]:
    """Compute the tiny network slowly: (6, h, w) to (3, h, w)."""
    head = _convolve(planes, make_weight(8, 6, 4, 4, seed=seed), stride=2, pad=1)
    active = np.where(head > 0, head, 0.1 * head)
    total = active + _convolve(active, make_weight(8, 8, 3, 3, seed=seed + 1), stride=1, pad=1)
    tail = _convolve(total, 0.1 * make_weight(12, 8, 1, 1, seed=seed + 2), stride=1, pad=0)
    _, rows, columns = tail.shape
    fine = tail.reshape(3, 2, 2, rows, columns).transpose(0, 3, 1, 4, 2)
    return (fine.reshape(3, 2 * rows, 2 * columns) + planes[3:]).astype(np.float32)


def _convolve(
    x: NDArray[np.floating], weight: NDArray[np.floating], *, stride: int, pad: int
) -> NDArray[np.float64]:
    padded = np.pad(x, ((0, 0), (pad, pad), (pad, pad))).astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(padded, weight.shape[2:], axis=(1, 2))
    return np.einsum("crskl,ockl->ors", windows[:, ::stride, ::stride], weight)


def tiny_members() -> dict[str, bytes]:
    """Give the members of the tiny bundle."""
    return {
        "psf.safetensors": psf_to_bytes(tiny_psf()),
        "network_m.onnx": tiny_network(),
        "golden.safetensors": golden_to_bytes(tiny_golden()),
        "card.md": b"# tiny\n\nA bundle for tests.\n",
    }


def write_tiny_bundle(folder: Path, name: str = "tiny.camkit") -> Path:
    """Write the tiny bundle and give its path."""
    path = folder / name
    write_bundle(path, tiny_manifest(), tiny_members())
    return path

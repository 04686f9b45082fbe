"""What is measured about a network at export, for the manifest and for `camkit check`."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from torch import nn

from camkit.bundle.manifest import HaloError, NetworkFacts
from camkit.contracts import FloatArray
from camkit.errors import UnsupportedError
from camkit.export.onnx_graph import check_parity, to_fp16, to_onnx
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.probe import halo_error_curve, perturbation_reach
from camkit.runtime.network.ranges import node_activations

PROBE_SEED: Final = 5
FP16_HEADROOM: Final = 4.0
HALO_STEP_PX: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredNetwork:
    """An exported network with its facts and members."""

    facts: NetworkFacts
    members: dict[str, bytes]


def measure_network(size: str, network: nn.Module, windows: list[FloatArray]) -> MeasuredNetwork:
    """Export a network and measure all that a bundle states of it.

    Args:
        size: S, M or L.
        network: The trained network.
        windows: (1, 6, h, w) typical inputs, those of the golden cases among them.

    Raises:
        ParityError: If torch and ONNX disagree.
    """
    model = to_onnx(network)
    parity = check_parity(network, model, windows)
    graph = inspect_graph(model)
    engine = NetworkEngine(model, threads=1)
    activations = node_activations(model, windows)
    reach = perturbation_reach(
        engine.run,
        _probe_size(graph.receptive_field_radius_px, graph.stride_px),
        np.random.default_rng(PROBE_SEED),
        stride_px=graph.stride_px,
    )
    reach_px = max(reach.halo_px, graph.receptive_field_radius_px)
    member = f"network_{size}.onnx"
    fp16_member: str | None = f"network_{size}_fp16.onnx"
    members = {member: model}
    try:
        members[f"network_{size}_fp16.onnx"] = to_fp16(model, activations, headroom=FP16_HEADROOM)
    except UnsupportedError:
        fp16_member = None
    facts = NetworkFacts(
        member=member,
        fp16_member=fp16_member,
        receptive_field_radius_px=graph.receptive_field_radius_px,
        receptive_field_probe_px=reach.halo_px,
        stride_px=graph.stride_px,
        global_operators=graph.global_operators,
        halo_error=_halo_error(engine, windows[0][0], reach_px, graph.stride_px),
        max_activation=max(activations.values()),
        node_activation=activations,
        fp16_headroom=FP16_HEADROOM,
        fp16_safe=fp16_member is not None,
        mac_per_pixel=graph.mac_per_pixel,
        bytes_per_pixel=graph.bytes_per_pixel,
        parity_max_abs=parity,
        parameters=graph.parameters,
    )
    return MeasuredNetwork(facts=facts, members=members)


def _probe_size(radius_px: int, stride_px: int) -> int:
    """Give a window that shows the whole reach with a stride to spare on each side."""
    side = max(2 * radius_px + 4 * stride_px, 8 * stride_px)
    return -(-side // (2 * stride_px)) * 2 * stride_px


def _halo_error(
    engine: NetworkEngine, sample: FloatArray, reach_px: int, stride_px: int
) -> tuple[HaloError, ...]:
    halos = range(0, reach_px + HALO_STEP_PX, HALO_STEP_PX)
    return tuple(
        HaloError(halo_px=cost.halo_px, max_abs=cost.max_abs, psnr_db=cost.psnr_db)
        for cost in halo_error_curve(engine.run, sample, halos, stride_px=stride_px)
    )

"""Facts measured of a graph by running it, free of torch."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import HaloError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph_walk import GraphFacts
from camkit.runtime.network.probe import TILE_PX, halo_error_curve, perturbation_reach
from camkit.runtime.network.ranges import node_activations

PROBE_SEED: Final = 5
HALO_STEP_PX: Final = 16
DEEP_STRIDE_PX: Final = 32
DEEP_ARENA: Final = 1.5
"""Taken by onnxruntime's arena over the live tensors of a network whose stride is at least that
(measured, decision 28): its tensors are of many sizes, whose holes stay empty."""
MOST_HALOS: Final = 32
"""Of an error curve; a network that reaches far has coarser steps."""


def arena_bytes(graph: GraphFacts) -> float:
    """Return the memory of a window per pixel."""
    share = DEEP_ARENA if graph.stride_px >= DEEP_STRIDE_PX else 1.0
    return graph.bytes_per_pixel * share


def measured_of(
    model: bytes, graph: GraphFacts, windows: Sequence[FloatArray]
) -> Mapping[str, Any]:
    """Return what running a network shows: reach, errors of short halos, activations.

    Args:
        model: The fp32 ONNX.
        graph: Read from it.
        windows: (1, channels, h, w) typical inputs; the first is the largest.
    """
    engine = NetworkEngine(model, threads=1, scale=graph.output_scale)
    activations = node_activations(model, windows)
    facts: dict[str, Any] = {
        "max_activation": max(activations.values()),
        "node_activation": activations,
    }
    if graph.global_operators:
        return facts
    reach = perturbation_reach(
        engine.run,
        _probe_size(graph.receptive_field_radius_px, graph.stride_px),
        np.random.default_rng(PROBE_SEED),
        stride_px=graph.stride_px,
        channels=graph.input_channels,
        scale=graph.output_scale,
    )
    reach_px = max(reach.halo_px, graph.receptive_field_radius_px)
    facts["receptive_field_probe_px"] = reach.halo_px
    if min(windows[0].shape[2:]) > TILE_PX:
        facts["halo_error"] = _halo_error(engine, windows[0][0], reach_px, graph.stride_px)
    return facts


def _probe_size(radius_px: int, stride_px: int) -> int:
    """Return a window that shows the whole reach with a stride to spare on each side."""
    side = max(2 * radius_px + 4 * stride_px, 8 * stride_px)
    return -(-side // (2 * stride_px)) * 2 * stride_px


def _halo_error(
    engine: NetworkEngine, sample: FloatArray, reach_px: int, stride_px: int
) -> tuple[HaloError, ...]:
    step = max(HALO_STEP_PX, -(-reach_px // (MOST_HALOS * HALO_STEP_PX)) * HALO_STEP_PX)
    halos = range(0, reach_px + step, step)
    costs = halo_error_curve(engine.run, sample, halos, stride_px=stride_px, scale=engine.scale)
    return tuple(
        HaloError(halo_px=cost.halo_px, max_abs=cost.max_abs, psnr_db=cost.psnr_db)
        for cost in costs
    )

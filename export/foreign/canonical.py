"""The canonical graph of a foreign network, and its proof against the original."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from camkit.arrays import FloatArray
from camkit.errors import BundleError, ParityError, UnsupportedError
from camkit.export.foreign.draft import Draft
from camkit.export.foreign.folded_values import folded
from camkit.export.foreign.onnx_file import ForeignModel
from camkit.export.foreign.operator_forms import rewrite_nodes
from camkit.export.foreign.pads import fold_pads
from camkit.export.foreign.shuffles import join_shuffles
from camkit.export.foreign.transposed import replace_transposed
from camkit.runtime.network.engine import NetworkEngine, tensor_values
from camkit.runtime.network.graph import ALLOWED_OPERATORS, MAX_IR, inspect_graph
from camkit.runtime.network.graph_walk import GraphFacts

OPSET: Final = 20
TOLERANCE: Final = 1e-5
"""Of canonical against original, over the largest number of either's output or 1."""
HALF_TOLERANCE: Final = 2e-2
"""Likewise against an original that computes in half precision."""
_SEED: Final = 53
_WINDOWS: Final = (((4, 4), 1.0), ((6, 5), 4.0), ((5, 9), 0.02))
"""(rows, columns) of cells of the stride, and brightness."""
_LEAST_PX: Final = 32
_REASONS: Final = {
    "MatMul": "it multiplies tensors of the picture, as attention does",
    "Gemm": "a dense layer takes a vector, not a picture",
    "Einsum": "it multiplies tensors of the picture, as attention does",
    "Reshape": "it joins rows and columns, so no window stands for the whole",
    "Transpose": "it turns axes of the picture",
    "Expand": "its size depends on the picture",
    "LayerNormalization": "a norm of another axis than the channels",
    "GridSample": "it samples at computed places, so its reach is open",
    "NonZero": "its size depends on the picture",
    "TopK": "it compares the whole picture",
    "Loop": "control flow",
    "If": "control flow",
    "Scan": "control flow",
    "LSTM": "it runs along the picture",
    "GRU": "it runs along the picture",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CanonicalGraph:
    """A foreign network as camkit can run it.

    Attributes:
        model: Serialised; input "input", output "output".
        facts: Read from it.
        difference: Largest |difference| from the original, over max(1, its largest |output|).
        half_difference: The same from the original in half precision; None if it is in float32.
    """

    model: bytes
    facts: GraphFacts
    difference: float
    half_difference: float | None = None


def canonical_draft(model: ForeignModel) -> tuple[Draft | None, tuple[str, ...]]:
    """Return the rewritten nodes, and every obstacle that is left.

    Args:
        model: A decoded network.

    Returns:
        None where the network does not even run.
    """
    if model.obstacles:
        return None, model.obstacles
    try:
        draft = folded(model)
    except BundleError as error:
        return None, (str(error),)
    rewrite_nodes(draft)
    join_shuffles(draft)
    rewrite_nodes(draft)
    fold_pads(draft)
    replace_transposed(draft)
    return draft, tuple(_obstacles(draft))


def _obstacles(draft: Draft) -> list[str]:
    counts: dict[str, int] = {}
    for node in draft.nodes:
        if node.op_type not in ALLOWED_OPERATORS:
            counts[node.op_type] = counts.get(node.op_type, 0) + 1
    findings = []
    for op, count in counts.items():
        times = "" if count == 1 else f" ({count} times)"
        reason = _REASONS.get(op, "it is not among the operators whose reach is known")
        findings.append(f"operator {op}{times}: {reason}")
    moving = sorted(
        {
            node.op_type
            for node in draft.nodes
            if node.op_type in ALLOWED_OPERATORS and draft.moving.keys() & set(node.input)
        }
    )
    findings += [f"{op} by numbers that depend on the size of the picture" for op in moving]
    return findings


def to_model(draft: Draft, channels: int) -> bytes:
    """Return the model of a draft: names counted, opset 20, sides open.

    Raises:
        BundleError: If it is no valid ONNX.
    """
    renamed = {draft.source: "input", draft.target: "output", "": ""}
    for place, name in enumerate(draft.constants):
        renamed[name] = f"c{place}"
    nodes = []
    for place, node in enumerate(draft.nodes):
        label = f"{place:03d}_{node.op_type.lower()}"
        for number, name in enumerate(node.output):
            renamed.setdefault(name, label if number == 0 else f"{label}_{number}")
        inputs = [renamed[name] for name in node.input]
        clean = helper.make_node(
            node.op_type, inputs, [renamed[name] for name in node.output], label
        )
        clean.attribute.extend(sorted(node.attribute, key=lambda a: str(a.name)))
        nodes.append(clean)
    graph = helper.make_graph(
        nodes,
        "network",
        [_port("input", channels, ("height", "width"))],
        [_port("output", draft.channels(draft.target), ("rows", "columns"))],
        [
            numpy_helper.from_array(np.ascontiguousarray(values), renamed[name])
            for name, values in draft.constants.items()
        ],
    )
    model = helper.make_model(
        graph,
        producer_name="camkit",
        ir_version=MAX_IR,
        opset_imports=[helper.make_opsetid("", OPSET)],
    )
    try:
        onnx.checker.check_model(model)
    except onnx.checker.ValidationError as error:
        reason = str(error).strip().splitlines()[0]
        raise BundleError(f"the network cannot be stated in opset {OPSET}: {reason}") from error
    return bytes(model.SerializeToString(deterministic=True))


def _port(name: str, channels: int, sides: tuple[str, str]) -> Any:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, *sides])


def canonical_graph(model: ForeignModel) -> CanonicalGraph:
    """Return the canonical graph of a network, proved against the original.

    Raises:
        UnsupportedError: Naming every obstacle, if there are any.
        ParityError: If the two disagree.
    """
    draft, obstacles = canonical_draft(model)
    if draft is None or obstacles:
        raise UnsupportedError("the network cannot be taken: " + "; ".join(obstacles))
    try:
        data = to_model(draft, model.channels)
        facts = inspect_graph(data)
    except BundleError as error:
        raise UnsupportedError(f"the network cannot be taken: {error}") from error
    difference, half = prove_equal(model, data, facts)
    return CanonicalGraph(model=data, facts=facts, difference=difference, half_difference=half)


def prove_equal(
    model: ForeignModel, data: bytes, facts: GraphFacts, more: tuple[FloatArray, ...] = ()
) -> tuple[float, float | None]:
    """Compare a canonical graph with its original on random windows, and on some others.

    Args:
        model: The original.
        data: The canonical graph.
        facts: Read from it.
        more: (1, channels, h, w) float32, multiples of the stride.

    Returns:
        The largest |difference| / max(1, max |y|); the same of the original in half precision, or
        None.

    Raises:
        ParityError: If the first exceeds 1e-5 or the second 0.02.
    """
    engine = NetworkEngine(data, threads=1, scale=facts.output_scale)
    source, target = model.source, model.target
    widened = model.proto.SerializeToString()
    is_half = model.type in ("float16", "bfloat16")
    worst, worst_half = 0.0, 0.0
    for window in (*_windows(facts), *more):
        result = engine.run(window)
        expected = tensor_values(widened, [target], {source: window})[target]
        worst = max(worst, _difference(result, expected))
        if is_half and float(np.abs(window).max(initial=0)) <= 1:
            half = {source: window.astype(np.float16)}
            expected = tensor_values(model.original, [target], half)[target]
            worst_half = max(worst_half, _difference(result, expected.astype(np.float32)))
    if not worst <= TOLERANCE or not worst_half <= HALF_TOLERANCE:
        raise ParityError(
            f"the canonical graph differs from the original by {max(worst, worst_half):.3g} of "
            f"full scale, allowed {TOLERANCE:g}; report this with the network"
        )
    return worst, worst_half if is_half else None


def _windows(facts: GraphFacts) -> list[FloatArray]:
    rng = np.random.default_rng(_SEED)
    cell = facts.stride_px * -(-_LEAST_PX // (4 * facts.stride_px))
    return [
        (brightness * rng.random((1, facts.input_channels, rows * cell, columns * cell))).astype(
            np.float32
        )
        for (rows, columns), brightness in _WINDOWS
    ]


def _difference(result: FloatArray, expected: FloatArray) -> float:
    if result.shape != expected.shape:
        raise ParityError(
            f"the canonical graph gives {result.shape}, the original {expected.shape}"
        )
    largest = max(1.0, float(np.abs(expected).max(initial=0)))
    return float(np.abs(result - expected).max(initial=0)) / largest

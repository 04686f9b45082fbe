"""Torch network -> ONNX bytes: plain operators, weights inside, no trace of the machine."""

import io
import logging
import warnings
from collections.abc import Iterable, Mapping
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING, Final

import numpy as np
import onnx
import torch
from onnx import helper, numpy_helper
from torch import nn

from camkit.arrays import FloatArray
from camkit.errors import ContractError, ParityError, UnsupportedError
from camkit.export.folding import fold_nodes
from camkit.models_def.training.first_weights import PRELU
from camkit.runtime.network.engine import NetworkEngine

if TYPE_CHECKING:
    from collections.abc import Iterator

OPSET: Final = 20
IR_VERSION: Final = 10
PARITY_TOLERANCE: Final = 1e-5
FP16_LIMIT: Final = 65504.0 / 4
_PARITY_SEED: Final = 20


def to_onnx(network: nn.Module, *, channels: int = 6, scale: int = 1) -> bytes:
    """Export a network with free height and width and prove it against torch.

    Args:
        network: (1, channels, h, w) -> (1, k, scale h, scale w); its `stride_px` divides h and w.
        channels: Input planes.
        scale: Samples along a side of the output for one pixel of the input.

    Returns:
        A serialised ONNX model, opset 20, IR 10, input "input", output "output". Equal weights
        give equal bytes.

    Raises:
        ContractError: If the network does not take `channels` planes, or gives another scale.
        ParityError: If onnxruntime does not reproduce torch.
    """
    declared = getattr(network, "in_channels", channels)
    if declared != channels:
        raise ContractError(f"the network takes {declared} planes, not {channels}")
    stride = int(getattr(network, "stride_px", 1))
    was_training = network.training
    network.eval()
    try:
        outputs = _output_planes(network, channels, scale)
        model = _stripped(_traced(network, channels, stride), outputs, scale)
        check_parity(network, model, _random_windows(channels, stride), scale=scale)
    finally:
        network.train(was_training)
    return model


def check_parity(
    network: nn.Module, model: bytes, windows: Iterable[FloatArray], *, scale: int = 1
) -> float:
    """Compare torch and onnxruntime.

    Args:
        network: The torch network, on the CPU.
        model: Its export.
        windows: (1, channels, h, w) float32 inputs.
        scale: Samples along a side of the output for one pixel of the input.

    Returns:
        The largest |difference| / max(1, max |y|) seen.

    Raises:
        ParityError: If that exceeds 1e-5 or is not finite.
    """
    engine = NetworkEngine(model, threads=1, scale=scale)
    worst = 0.0
    for window in windows:
        with torch.no_grad():
            expected = np.asarray(network(torch.from_numpy(window)))
        got = engine.run(window)
        largest = max(1.0, float(np.abs(expected).max()))
        difference = float(np.abs(got - expected).max()) / largest
        if not difference <= PARITY_TOLERANCE:
            raise ParityError(
                f"torch and ONNX differ by {difference:.3g} of full scale on {window.shape}, "
                f"allowed {PARITY_TOLERANCE:g}; export again, and report the network's name"
            )
        worst = max(worst, difference)
    return worst


def to_fp16(model: bytes, activations: Mapping[str, float], *, headroom: float = 1.0) -> bytes:
    """Convert an fp32 model to half precision with fp32 input and output.

    Args:
        model: Serialised fp32 ONNX model.
        activations: Largest |activation| per value name, measured in fp32; must cover every node.
        headroom: Factor by which captures may exceed those that were measured.

    Returns:
        A serialised model of about half the size.

    Raises:
        UnsupportedError: If an activation or a weight may leave the range of half precision.
    References: ARCHITECTURE.md, The bundle: activations x headroom < 65504 / 4.
    """
    proto = onnx.load_from_string(model)
    graph = proto.graph
    for value in (name for node in graph.node for name in node.output):
        if not activations.get(value, np.inf) * headroom < FP16_LIMIT:
            raise UnsupportedError(
                f"half precision needs |activation| < {FP16_LIMIT:g}; {value} reaches "
                f"{activations.get(value, np.inf):g} x {headroom:g}: keep this network in fp32"
            )
    for i, initializer in enumerate(graph.initializer):
        if initializer.data_type == onnx.TensorProto.FLOAT:
            graph.initializer[i].CopyFrom(_half(initializer))
    _cast_edges(graph)
    return bytes(proto.SerializeToString(deterministic=True))


def _half(initializer: onnx.TensorProto) -> onnx.TensorProto:
    values = numpy_helper.to_array(initializer)
    if np.abs(values).max(initial=0) >= FP16_LIMIT:
        raise UnsupportedError(f"weight {initializer.name} leaves the range of half precision")
    return numpy_helper.from_array(values.astype(np.float16), initializer.name)


def _cast_edges(graph: onnx.GraphProto) -> None:
    for node in graph.node:
        for names in (node.input, node.output):
            for i, name in enumerate(names):
                if name in ("input", "output"):
                    names[i] = f"{name}_half"
    nodes = list(graph.node)
    to_half = helper.make_node(
        "Cast", ["input"], ["input_half"], name="to_half", to=onnx.TensorProto.FLOAT16
    )
    to_float = helper.make_node(
        "Cast", ["output_half"], ["output"], name="to_float", to=onnx.TensorProto.FLOAT
    )
    del graph.node[:]
    graph.node.extend([to_half, *nodes, to_float])


@contextmanager
def _quiet() -> "Iterator[None]":
    """Keep the exporter's notes on its own future off the caller's terminal."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _traced(network: nn.Module, channels: int, stride: int) -> onnx.ModelProto:
    height = torch.export.Dim("height", min=2, max=65536 // stride)
    width = torch.export.Dim("width", min=2, max=65536 // stride)
    example = torch.zeros(1, channels, 4 * stride, 5 * stride)
    with _quiet():
        program = torch.onnx.export(
            network,
            (example,),
            dynamo=True,
            opset_version=OPSET,
            input_names=["input"],
            output_names=["output"],
            dynamic_shapes=({2: stride * height, 3: stride * width},),
            verbose=False,
        )
    if program is None:
        raise ParityError("the exporter gave no program; report this with the torch version")
    return program.model_proto


def _output_planes(network: nn.Module, channels: int, scale: int) -> int:
    """Return the output planes of a network.

    Raises:
        ContractError: If its output is not (1, k, scale h, scale w).
    """
    side = 4 * int(getattr(network, "stride_px", 1))
    with torch.no_grad():
        shape = tuple(network(torch.zeros(1, channels, side, side)).shape)
    if len(shape) != 4 or shape[0] != 1 or shape[2:] != (scale * side, scale * side):
        raise ContractError(
            f"the network makes {shape} of (1, {channels}, {side}, {side}); its output must be "
            f"{scale} time(s) as fine as its input"
        )
    return int(shape[1])


def _stripped(traced: onnx.ModelProto, outputs: int, scale: int) -> bytes:
    """Rebuild the model from its arithmetic alone: names counted, no paths, no stack traces."""
    graph = traced.graph
    fold_nodes(graph)
    renamed = {"input": "input", "output": "output"}
    weights = []
    for i, weight in enumerate(graph.initializer):
        renamed[weight.name] = f"c{i}" if weight.name.startswith("val_") else str(weight.name)
        weights.append(numpy_helper.from_array(numpy_helper.to_array(weight), renamed[weight.name]))
    nodes = []
    for i, node in enumerate(graph.node):
        sloped = node.name.endswith(PRELU)
        name = f"{i:03d}{PRELU if sloped else '_' + node.op_type.lower()}"
        for number, value in enumerate(node.output):
            renamed.setdefault(value, f"{name}_{number}" if number else name)
        inputs = [renamed.get(value, value) for value in node.input]
        clean = helper.make_node(
            node.op_type, inputs, [renamed[value] for value in node.output], name
        )
        clean.attribute.extend(sorted(node.attribute, key=lambda a: str(a.name)))
        nodes.append(clean)
    channels = graph.input[0].type.tensor_type.shape.dim[1].dim_value
    float32 = onnx.TensorProto.FLOAT
    prefix = "" if scale == 1 else f"{scale}_"
    sides = [f"{prefix}height", f"{prefix}width"]
    model = helper.make_model(
        helper.make_graph(
            nodes,
            "network",
            [helper.make_tensor_value_info("input", float32, [1, channels, "height", "width"])],
            [helper.make_tensor_value_info("output", float32, [1, outputs, *sides])],
            weights,
        ),
        producer_name="camkit",
        ir_version=IR_VERSION,
        opset_imports=[helper.make_opsetid("", OPSET)],
    )
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def _random_windows(channels: int, stride: int) -> "Iterator[FloatArray]":
    rng = np.random.default_rng(_PARITY_SEED)
    for height, width, scale in ((2, 2, 1.0), (5, 3, 4.0), (8, 11, 0.01)):
        shape = (1, channels, height * stride, width * stride)
        yield (scale * rng.random(shape)).astype(np.float32)

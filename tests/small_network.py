"""A small network of the shipped kind, made without torch: stride 4, halo 16 px, 16 channels."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

STRIDE_PX = 4
HALO_PX = 16
CHANNELS = 16


class _Builder:
    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[onnx.TensorProto] = []

    def add(self, op: str, *inputs: str, **attributes: object) -> str:
        name = f"{len(self.nodes)}_{op}"
        self.nodes.append(helper.make_node(op, list(inputs), [name], name=name, **attributes))
        return name

    def constant(self, name: str, values: np.ndarray) -> str:
        self.weights.append(numpy_helper.from_array(values, name))
        return name

    def conv(self, source: str, shape: tuple[int, int, int, int], stride: int = 1) -> str:
        pad = (shape[2] - stride + 1) // 2
        scale = np.sqrt(2.0 / np.prod(shape[1:]))
        weight = (scale * self._rng.standard_normal(shape)).astype(np.float32)
        name = self.constant(f"w{len(self.weights)}", weight)
        return self.add(
            "Conv",
            source,
            name,
            kernel_shape=list(shape[2:]),
            strides=[stride, stride],
            pads=[pad] * 4,
        )

    def shuffle(self, source: str) -> str:
        return self.add("DepthToSpace", source, blocksize=2, mode="CRD")


def small_network(seed: int = 0, *, input_name: str = "input") -> bytes:
    """Serialise the network with random weights; (1, 6, h, w) -> (1, 3, h, w)."""
    b, c = _Builder(seed), CHANNELS
    fine = b.add("LeakyRelu", b.conv(input_name, (c, 6, 6, 6), 2), alpha=0.1)
    coarse = b.add("LeakyRelu", b.conv(fine, (c, c, 2, 2), 2), alpha=0.1)
    coarse = b.add("LeakyRelu", b.conv(coarse, (c, c, 3, 3)), alpha=0.1)
    coarse = b.add("LeakyRelu", b.conv(coarse, (c, c, 3, 3)), alpha=0.1)
    merged = b.add("Add", b.shuffle(b.conv(coarse, (4 * c, c, 1, 1))), fine)
    rough = b.shuffle(b.conv(merged, (12, c, 3, 3)))
    start, end, axis = (b.constant(n, np.array([v])) for n, v in (("s", 3), ("e", 6), ("a", 1)))
    planes = b.add("Slice", input_name, start, end, axis)
    b.nodes.append(helper.make_node("Add", [planes, rough], ["output"], name="last"))
    shape = [1, 6, "height", "width"]
    graph = helper.make_graph(
        b.nodes,
        "small",
        [helper.make_tensor_value_info(input_name, TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, [1, 3, "height", "width"])],
        b.weights,
    )
    model = helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 20)])
    return bytes(model.SerializeToString(deterministic=True))

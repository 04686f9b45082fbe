"""Graphs of networks as people have them: a plain U-Net, a NAFNet, a DenseNet; random weights."""

from typing import Final

import numpy as np
import onnx
from onnx import helper

from tests.bundle_factory import make_model


class GraphBuilder:
    """Adds nodes one after the other; tensors are known by name, with their channels."""

    def __init__(self, channels: tuple[int, int] = (6, 3), seed: int = 0) -> None:
        self._ends = channels
        self._rng = np.random.default_rng(seed)
        self._nodes: list[onnx.NodeProto] = []
        self._weights: dict[str, np.ndarray] = {}
        self.channels = {"input": channels[0]}

    def constant(self, values: np.ndarray) -> str:
        """Add a constant."""
        name = f"c{len(self._weights)}"
        self._weights[name] = values
        return name

    def add(self, op: str, *inputs: str, channels: int = 0, out: str = "", **facts: object) -> str:
        """Add a node; its output has the channels of its first input unless given."""
        label = f"{op}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(op, list(inputs), [out or label], label, **facts))
        self.channels[out or label] = channels or self.channels[inputs[0]]
        return out or label

    def conv(self, source: str, channels: int, kernel: int = 3, **facts: object) -> str:
        """Add a convolution that keeps the size unless strides are given."""
        shape = channels, self.channels[source] // int(str(facts.get("group", 1))), kernel, kernel
        pads = [kernel // 2 * (kernel % 2)] * 4
        out = str(facts.pop("out", ""))
        weights = self.constant(self._values(shape))
        return self.add("Conv", source, weights, channels=channels, out=out, pads=pads, **facts)

    def double(self, source: str, channels: int) -> str:
        """Add a transposed convolution to twice the size."""
        weights = self._values((self.channels[source], channels, 2, 2))
        place = self.constant(weights)
        return self.add("ConvTranspose", source, place, channels=channels, strides=[2, 2])

    def split(self, source: str) -> tuple[str, str]:
        """Add a split into halves of the channels."""
        parts = f"{source}_a", f"{source}_b"
        node = helper.make_node(
            "Split", [source], list(parts), source + "_s", axis=1, num_outputs=2
        )
        self._nodes.append(node)
        self.channels |= dict.fromkeys(parts, self.channels[source] // 2)
        return parts

    def model(self) -> bytes:
        """Return the model."""
        made = make_model(self._nodes, self._weights, channels=self._ends)
        return made.SerializeToString(deterministic=True)

    def _values(self, shape: tuple[int, ...]) -> np.ndarray:
        spread = 0.5 / np.sqrt(np.prod(shape[1:]))
        return (spread * self._rng.standard_normal(shape)).astype(np.float32)


def unet(width: int = 16, levels: int = 3) -> bytes:
    """Return a U-Net that begins at full size: max pooling, transposed convolutions, skips."""
    b, at, skips = GraphBuilder(), "input", []

    def block(source: str, channels: int) -> str:
        return b.add("Relu", b.conv(b.add("Relu", b.conv(source, channels)), channels))

    for level in range(levels - 1):
        at = block(at, width << level)
        skips.append(at)
        at = b.add("MaxPool", at, kernel_shape=[2, 2], strides=[2, 2])
    at = block(at, width << levels - 1)
    for level in reversed(range(levels - 1)):
        fine, skip = b.double(at, width << level), skips.pop()
        both = b.add("Concat", fine, skip, channels=2 * (width << level), axis=1)
        at = block(both, width << level)
    b.conv(at, 3, 1, out="output")
    return b.model()


def nafnet(width: int = 16, *, pooled: bool = True) -> bytes:
    """Return a NAFNet of three levels: norms over channels, gates, and pooling over the picture."""
    b, skips = GraphBuilder(), []
    axes, least = b.constant(np.array([1])), b.constant(np.float32([1e-6]))

    def norm(source: str) -> str:
        mean = b.add("ReduceMean", source, axes, channels=1, keepdims=1)
        rest = b.add("Sub", source, mean)
        variance = b.add("ReduceMean", b.add("Mul", rest, rest), axes, channels=1, keepdims=1)
        scaled = b.add("Div", rest, b.add("Sqrt", b.add("Add", variance, least)))
        return b.add("Mul", scaled, b.constant(np.ones((1, b.channels[source], 1, 1), np.float32)))

    def gate(source: str) -> str:
        return b.add("Mul", *b.split(source))

    def block(source: str) -> str:
        count = b.channels[source]
        wide = b.conv(b.conv(norm(source), 2 * count, 1), 2 * count, 3, group=2 * count)
        inner = gate(wide)
        if pooled:
            inner = b.add("Mul", inner, b.conv(b.add("GlobalAveragePool", inner), count, 1))
        first = b.add("Add", source, b.conv(inner, count, 1))
        return b.add("Add", first, b.conv(gate(b.conv(norm(first), 2 * count, 1)), count, 1))

    at = b.conv("input", width)
    for _ in range(2):
        at = block(at)
        skips.append(at)
        at = b.conv(at, 2 * b.channels[at], 2, strides=[2, 2])
    at = block(at)
    for _ in range(2):
        wide, half = b.conv(at, 2 * b.channels[at], 1), b.channels[at] // 2
        fine = b.add("DepthToSpace", wide, channels=half, blocksize=2, mode="CRD")
        at = block(b.add("Add", fine, skips.pop()))
    b.conv(at, 3, out="output")
    return b.model()


def densenet(growth: int = 12, layers: int = 5) -> bytes:
    """Return a dense block: every layer takes all that was made before it."""
    b = GraphBuilder()
    at = b.conv("input", growth)
    for _ in range(layers):
        more = b.add("LeakyRelu", b.conv(at, growth), alpha=0.1)
        at = b.add("Concat", at, more, channels=b.channels[at] + growth, axis=1)
    b.conv(at, 3, 1, out="output")
    return b.model()


def recursive(width: int = 24, steps: int = 6) -> bytes:
    """Return residual blocks at full size with sums over several of them."""
    b = GraphBuilder()
    first = at = b.conv("input", width)
    for _ in range(steps):
        inner = b.add("Tanh", b.conv(at, width))
        at = b.add("Add", b.add("Sigmoid", b.conv(inner, width, 5)), first)
    b.conv(at, 3, out="output")
    return b.model()


GRAPHS: Final = {
    "unet": unet,
    "deep unet": lambda: unet(8, 6),
    "wide unet": lambda: unet(32, 2),
    "nafnet": nafnet,
    "nafnet without pooling": lambda: nafnet(pooled=False),
    "densenet": densenet,
    "recursive": recursive,
}

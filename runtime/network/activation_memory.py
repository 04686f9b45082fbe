"""Memory of the activations of a network, counted along its nodes, per pixel of its input.

    live    tensors that are needed at the same time, each freed after its last use
    block   the one block in which onnxruntime lays them once it knows their sizes: each tensor
            goes to the tightest gap between those that are needed at the same time

The arena of onnxruntime takes more than either where tensors are of many sizes: holes between them
stay empty. A U-Net takes 2.3 times its live tensors there, 1.2 times in a block.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from camkit.runtime.network.operators import ELEMENTWISE, Extent, Node

_BYTES_PER_VALUE: Final = 4
_BLOCK_CHANNELS: Final = 16
"""Of onnxruntime's blocked convolutions; 8 on processors without AVX-512."""
BLOCK_MARGIN: Final = 1.3
"""Over the counted block: copies in the order of channels that a kernel of onnxruntime takes. The
graphs of the tests need 0.8 to 1.25 times the block (x86 with AVX-512)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ActivationMemory:
    """Bytes per pixel of the input.

    Attributes:
        live: Peak of the tensors that are needed at the same time.
        block: What a run takes that lays them in one block, a copy of the input included.
    """

    live: float
    block: float


@dataclass(slots=True)
class _Block:
    """Tensors in one block, in values per pixel.

    Attributes:
        places: Start and size of the tensors that are needed now.
        top: The farthest end of any so far.
    """

    places: dict[str, tuple[float, float]] = field(default_factory=dict)
    top: float = 0.0

    def add(self, name: str, size: float) -> None:
        """Place a tensor in the tightest gap, or behind the last one."""
        end, gaps = 0.0, list[tuple[float, float]]()
        for start, length in sorted(self.places.values()):
            if start - end >= size:
                gaps.append((start - end, end))
            end = max(end, start + length)
        start = min(gaps)[1] if gaps else end
        self.places[name] = start, size
        self.top = max(self.top, start + size)

    def rename(self, old: str, new: str) -> None:
        """Reuse memory: a tensor takes the place of one that nobody needs any more."""
        self.places[new] = self.places.pop(old)


@dataclass(frozen=True, slots=True, kw_only=True)
class Activations:
    """The tensors of a network.

    Attributes:
        extents: Of every tensor.
        workspace: Output of a node -> values per pixel that it needs besides.
        blocked: Outputs of blocked convolutions, which have whole blocks of channels.
    """

    extents: Mapping[str, Extent]
    workspace: Mapping[str, float]
    blocked: Collection[str]

    def values(self, name: str) -> float:
        """Return the values of a tensor per pixel."""
        return self.extents[name].samples_per_pixel

    def block_values(self, name: str) -> float:
        """Return the values of a tensor per pixel as onnxruntime lays it."""
        if name not in self.blocked:
            return self.values(name)
        channels = self.extents[name].channels
        return self.values(name) * (-(-channels // _BLOCK_CHANNELS) * _BLOCK_CHANNELS) / channels


def activation_memory(
    nodes: Sequence[Node], activations: Activations, *, ends: tuple[str, str]
) -> ActivationMemory:
    """Count the memory of a run.

    An elementwise node writes over an operand that nobody needs any more, as onnxruntime does.

    Args:
        nodes: In the order of computation.
        activations: Their tensors.
        ends: Names of the input and the output of the network, which the caller holds.
    """
    (source, target), extents = ends, activations.extents
    last = {name: index for index, node in enumerate(nodes) for name in node.inputs}
    last[target] = len(nodes)
    alive, block, peak = set(tensor_names(extents, [source])), _Block(), 0.0
    for index, node in enumerate(nodes):
        dying = [name for name in tensor_names(extents, node.inputs) if last.get(name) == index]
        outputs = tensor_names(extents, node.outputs)
        if node.op in ELEMENTWISE and dying:
            alive.discard(max(dying, key=activations.values))
        alive |= set(outputs)
        room = sum(activations.workspace.get(name, 0.0) for name in node.outputs)
        peak = max(peak, room + sum(map(activations.values, alive)))
        if target in outputs and target in activations.blocked:
            room += activations.block_values(target)
        sizes = {name: activations.block_values(name) for name in outputs if name != target}
        _lay(block, sizes, dying if node.op in ELEMENTWISE else [], room)
        for name in (*dying, *(name for name in outputs if name not in last)):
            alive.discard(name)
            block.places.pop(name, None)
    copied = activations.values(source)
    return ActivationMemory(
        live=peak * _BYTES_PER_VALUE,
        block=(block.top + copied) * _BYTES_PER_VALUE * BLOCK_MARGIN,
    )


def _lay(block: _Block, sizes: Mapping[str, float], dying: Sequence[str], room: float) -> None:
    """Place the outputs of a node, over a dying tensor of their size, and its work memory."""
    for name, size in sizes.items():
        reusable = [one for one in dying if one in block.places and block.places[one][1] >= size]
        if reusable:
            block.rename(reusable[0], name)
        else:
            block.add(name, size)
    if room:
        block.add("", room)
        del block.places[""]


def tensor_names(extents: Mapping[str, Extent], names: Iterable[str]) -> list[str]:
    """Return those of some names that are tensors, not constants."""
    return [name for name in names if name in extents]

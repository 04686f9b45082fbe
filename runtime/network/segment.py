"""A part of a network between two cuts, as a network of its own; free of onnx.

Made by `graph_cuts`, run by `row_network`.
"""

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A tensor that crosses cuts.

    Attributes:
        name: In the graph.
        channels: Of the tensor.
        step: Pixels from sample to sample.
    """

    name: str
    channels: int
    step: Fraction

    def samples(self, pixels: int) -> int:
        """Return the rows or columns of so many pixels."""
        return int(pixels / self.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """An input of a segment.

    Attributes:
        port: The tensor that it is taken from.
        name: Of the input in the model of the segment.
        block: Side of the blocks of pixels that the channels of the tensor are put to on the way;
            1 for as it is.
        depth_first: Whether the channels of a block lie apart, as DepthToSpace has them in its
            mode DCR.
    """

    port: Port
    name: str
    block: int = 1
    depth_first: bool = False

    @property
    def channels(self) -> int:
        """Return the channels of the input."""
        return self.port.channels // self.block**2

    @property
    def step(self) -> Fraction:
        """Return the pixels from sample to sample of the input."""
        return self.port.step / self.block


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Consecutive nodes of a network as a network of their own.

    Attributes:
        model: ONNX, with the weights inside.
        feeds: Tensors that it takes.
        outputs: Tensors that others take, or the result.
        lattice_px: Its strips begin and end on multiples of it.
        reach_px: Rows beyond a strip that it looks at, a multiple of the lattice.
        strip_bytes: Memory of a run per pixel of its strip, inputs and outputs included.
        held_bytes: That of its outputs.
        mac_per_pixel: Its multiply-accumulates.
    """

    model: bytes
    feeds: tuple[Feed, ...]
    outputs: tuple[Port, ...]
    lattice_px: int
    reach_px: int
    strip_bytes: float
    held_bytes: float
    mac_per_pixel: float

"""The operators of picture networks: which samples each one reads, and how grids change.

For one axis an operator is a `Window`: the first and last input sample that a run of output
samples reads, in integers, so that the phase of the stride is exact:

    operator (kernel k, span = dilation (k - 1))  first read             last read
    convolution, pooling (stride s, pad p)        first s - p            last s - p + span
    transposed convolution                        ceil((first + p - span) / s)   (last + p) // s
    DepthToSpace b, nearest resize by b           first // b             last // b
    SpaceToDepth b                                first b                last b + b - 1
    Pad by p: zeros, edge or mirrored             first - p              last - p
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import BundleError

ELEMENTWISE: Final = (
    frozenset({"Add", "Sub", "Mul", "Div", "Max", "Min", "Neg", "Abs", "Sqrt"})
    | {"Relu", "LeakyRelu", "PRelu", "Elu", "Gelu", "Sigmoid", "HardSigmoid", "HardSwish"}
    | {"Tanh", "Softplus", "Clip", "Identity", "Cast", "BatchNormalization"}
    | {"Pow", "Exp", "Log", "Erf", "Where"}
    | {"Greater", "GreaterOrEqual", "Less", "LessOrEqual", "Equal"}
)
"""One sample out from the same sample in; second inputs may be constants per channel."""
COMPARISONS: Final = frozenset({"Greater", "GreaterOrEqual", "Less", "LessOrEqual", "Equal"})
"""They give true or false, which only Where takes."""
PAD_MODES: Final = ("constant", "reflect", "edge")
NORMALIZATIONS: Final = frozenset({"InstanceNormalization", "GroupNormalization"})
REDUCTIONS: Final = frozenset({"ReduceMean", "ReduceSum", "ReduceMax", "ReduceMin"})
GLOBAL_POOLS: Final = frozenset({"GlobalAveragePool", "GlobalMaxPool"})

_SPATIAL: Final = (2, 3)
_NDIM: Final = 4
_MAX_SCALE: Final = 64
_MAX_KERNEL: Final = 4096
_MIN_STEP: Final = Fraction(1, 8)
_MAX_STEP: Final = 4096
_MAX_CHANNELS: Final = 2**16
_MAX_EXTRA_PX: Final = 64

Constants = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """One operator: its type, a name for messages, tensors in and out, attributes."""

    op: str
    label: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: Mapping[str, Any]

    def integers(self, name: str, default: list[int]) -> list[int]:
        """Return an attribute that is a list of integers."""
        values = self.attributes.get(name, default)
        if not isinstance(values, list) or not all(isinstance(v, int) for v in values):
            raise BundleError(f"{self.label}: {name} must be a list of integers; got {values!r}")
        return values

    def integer(self, name: str, default: int) -> int:
        """Return an attribute that is an integer."""
        value = self.attributes.get(name, default)
        if not isinstance(value, int):
            raise BundleError(f"{self.label}: {name} must be an integer; got {value!r}")
        return value

    def text(self, name: str, default: str) -> str:
        """Return an attribute that is a word."""
        value = self.attributes.get(name, default)
        return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The window of an operator along one axis.

    Attributes:
        stride: Input samples per output sample.
        size: Samples out for n samples in.
        reads: First and last input sample read for the first and last output sample.
    """

    stride: Fraction
    size: Callable[[int], int]
    reads: Callable[[int, int], tuple[int, int]]


Windows = tuple[Window, Window]
"""Rows, columns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis of a tensor: a sample every `step` picture pixels, size / step + extra of them."""

    step: Fraction = Fraction(1)
    extra: int = 0

    def output_of(self, window: Window) -> "Axis":
        """Return this axis behind an operator.

        Raises:
            BundleError: If the grid becomes absurdly coarse or fine.
        """
        step = self.step * window.stride
        if not _MIN_STEP <= step <= _MAX_STEP:
            raise BundleError(f"a tensor has a sample every {step} pixels; refused")
        return Axis(step=step, extra=window.size(self.extra))


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Channels of a tensor and its grid (rows, columns), None once space was reduced away."""

    channels: int
    axes: tuple[Axis, Axis] | None

    @property
    def samples_per_pixel(self) -> float:
        """Values per picture pixel, all channels together."""
        if self.axes is None:
            return 0.0
        return self.channels / float(self.axes[0].step * self.axes[1].step)

    def output_of(self, channels: int, windows: Windows | None = None) -> "Extent":
        """Return the extent behind an operator with the given windows."""
        axes = self.axes
        if axes is not None and windows is not None:
            axes = axes[0].output_of(windows[0]), axes[1].output_of(windows[1])
        return Extent(channels=channels, axes=axes)


def convolution_windows(node: Node, kernel: tuple[int, ...]) -> Windows:
    """Return the windows of a convolution or pooling, transposed or not.

    Raises:
        BundleError: If a parameter is out of range, or size or padding depend on the picture
            (auto_pad, ceil_mode, output_shape).
    """
    if node.text("auto_pad", "NOTSET") != "NOTSET":
        raise BundleError(f"{node.label}: auto_pad is refused; export with explicit pads")
    if node.integer("ceil_mode", 0) or "output_shape" in node.attributes:
        raise BundleError(f"{node.label}: ceil_mode and output_shape are refused")
    strides = node.integers("strides", [1, 1])
    dilations = node.integers("dilations", [1, 1])
    pads = node.integers("pads", [0, 0, 0, 0])
    growth = node.integers("output_padding", [0, 0])
    if (len(kernel), len(strides), len(dilations), len(pads), len(growth)) != (2, 2, 2, 4, 2):
        raise BundleError(f"{node.label}: kernel, strides, dilations and pads must be 2-D")
    values = [*kernel, *strides, *dilations]
    if min(values) < 1 or min(pads + growth) < 0 or max(values + pads + growth) > _MAX_KERNEL:
        raise BundleError(f"{node.label}: kernel, strides, dilations or pads out of range")
    make = _transposed if node.op == "ConvTranspose" else _convolved
    rows, columns = (
        make(strides[i], dilations[i] * (kernel[i] - 1), (pads[i], pads[i + 2]), growth[i])
        for i in range(2)
    )
    return rows, columns


def _convolved(stride: int, span: int, pads: tuple[int, int], _growth: int) -> Window:
    return Window(
        stride=Fraction(stride),
        size=lambda n: (n + sum(pads) - span - 1) // stride + 1,
        reads=lambda first, last: (first * stride - pads[0], last * stride - pads[0] + span),
    )


def _transposed(stride: int, span: int, pads: tuple[int, int], growth: int) -> Window:
    return Window(
        stride=Fraction(1, stride),
        size=lambda n: (n - 1) * stride + span + 1 - sum(pads) + growth,
        reads=lambda first, last: (
            -((span - first - pads[0]) // stride),
            (last + pads[0]) // stride,
        ),
    )


def shuffle_window(block: int) -> Window:
    """Return the window of DepthToSpace."""
    return Window(
        stride=Fraction(1, block),
        size=lambda n: n * block,
        reads=lambda first, last: (first // block, last // block),
    )


def place_run(run: tuple[int, int], block: int, place: int) -> tuple[int, int]:
    """Return the samples that DepthToSpace puts on one place of every block of a run of its output.

    Args:
        run: First and last sample of the output along an axis.
        block: Its side.
        place: Along that axis, from 0.
    """
    return -((place - run[0]) // block), (run[1] - place) // block


def unshuffle_window(block: int) -> Window:
    """Return the window of SpaceToDepth."""
    return Window(
        stride=Fraction(block),
        size=lambda n: n // block,
        reads=lambda first, last: (first * block, last * block + block - 1),
    )


def pad_windows(node: Node, pads: list[int]) -> Windows:
    """Return the windows of a Pad.

    What lies beyond the picture's border is made of samples within the reach of who reads it.

    Args:
        node: The Pad.
        pads: Samples before every axis, then behind every axis.

    Raises:
        BundleError: If it pads other axes than rows and columns, cuts, or has another mode.
    """
    mode = node.text("mode", "constant")
    if mode not in PAD_MODES:
        raise BundleError(f"{node.label}: Pad of the mode {mode!r} is refused")
    if len(pads) != 2 * _NDIM or any(pads[i] for i in (0, 1, _NDIM, _NDIM + 1)):
        raise BundleError(f"{node.label}: Pad is admitted along rows and columns only")
    if min(pads) < 0 or max(pads) > _MAX_KERNEL:
        raise BundleError(f"{node.label}: pads {pads} are out of range")
    rows, columns = (_convolved(1, 0, (pads[i], pads[i + _NDIM]), 0) for i in _SPATIAL)
    return rows, columns


def resize_windows(node: Node, constants: Constants) -> Windows:
    """Return the windows of a Resize by constant factors, nearest or linear.

    Raises:
        BundleError: If its factors are not constant (it then depends on the picture's size), or
            its mode is not one of those two.
    """
    mode = node.text("mode", "nearest")
    if mode not in ("nearest", "linear") or node.integer("antialias", 0):
        raise BundleError(f"{node.label}: only plain nearest and linear Resize are admitted")
    scales = constants.get(node.inputs[2]) if len(node.inputs) > 2 else None
    if scales is None or scales.shape != (_NDIM,) or any(scales[:2] != 1):
        raise BundleError(f"{node.label}: Resize needs 4 constant scales, the first two 1")
    rows, columns = (_resize_window(node, mode, float(scale)) for scale in scales[2:])
    return rows, columns


def _resize_window(node: Node, mode: str, scale: float) -> Window:
    factor = Fraction(scale).limit_denominator(_MAX_SCALE) if math.isfinite(scale) else Fraction(0)
    if not Fraction(1, _MAX_SCALE) <= factor <= _MAX_SCALE or float(factor) != scale:
        raise BundleError(f"{node.label}: Resize by {scale} is refused; use a plain ratio")
    centre = node.text("coordinate_transformation_mode", "half_pixel")
    if centre not in ("half_pixel", "pytorch_half_pixel", "asymmetric", "align_corners"):
        raise BundleError(f"{node.label}: Resize coordinates {centre!r} are refused")
    offset = Fraction(0) if centre == "asymmetric" else (1 / factor - 1) / 2
    rounding = node.text("nearest_mode", "round_prefer_floor")

    def reads(first: int, last: int) -> tuple[int, int]:
        low, high = first / factor + offset, last / factor + offset
        if mode == "linear" or rounding not in ("floor", "ceil"):
            # Both neighbours; rounding to the nearer one may go either way.
            return math.floor(low), math.ceil(high)
        turn = math.floor if rounding == "floor" else math.ceil
        return turn(low), turn(high)

    return Window(stride=1 / factor, size=lambda n: math.floor(n * factor), reads=reads)


def is_corner_aligned(node: Node) -> bool:
    """Return whether a Resize depends on the size of the whole picture."""
    return node.text("coordinate_transformation_mode", "half_pixel") == "align_corners"


def reduced_axes(node: Node, constants: Constants) -> frozenset[int]:
    """Return the axes, from 0, over which a reduction or softmax runs.

    Raises:
        BundleError: If they are computed.
    """
    if node.op == "Softmax":
        return frozenset({node.integer("axis", -1) % _NDIM})
    axes = node.integers("axes", [])
    if len(node.inputs) > 1 and node.inputs[1]:
        if node.inputs[1] not in constants:
            raise BundleError(f"{node.label}: the axes must be a constant")
        axes = [int(axis) for axis in constants[node.inputs[1]].ravel()]
    if not axes and not node.integer("noop_with_empty_axes", 0):
        axes = list(range(_NDIM))
    return frozenset(axis % _NDIM for axis in axes)


def reduces_space(axes: frozenset[int]) -> bool:
    """Return whether rows or columns are among some axes."""
    return not axes.isdisjoint(_SPATIAL)


def check_broadcast(node: Node, constants: Constants) -> None:
    """Refuse a constant operand that varies over space, since pictures have any size.

    Raises:
        BundleError: If it does.
    """
    for name in node.inputs:
        shape = np.shape(constants[name]) if name in constants else ()
        if len(shape) > _NDIM or any(side != 1 for side in shape[-2:]):
            raise BundleError(
                f"{node.label}: constant {name!r} of shape {shape} varies over space; refused"
            )


def check_extents(node: Node, extents: Sequence[Extent]) -> None:
    """Refuse tensors that would be absurdly large whatever the picture."""
    for extent in extents:
        if extent.channels > _MAX_CHANNELS:
            raise BundleError(
                f"{node.label}: gives {extent.channels} channels; at most {_MAX_CHANNELS} are "
                "admitted"
            )
        if any(axis.extra * axis.step > _MAX_EXTRA_PX for axis in extent.axes or ()):
            raise BundleError(
                f"{node.label}: pads the picture by more than {_MAX_EXTRA_PX} px; refused"
            )

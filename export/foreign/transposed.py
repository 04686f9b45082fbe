"""Transposed convolutions as convolutions on the coarse grid, whose pixels are put in place.

Of an output with s samples for one of the input, the samples at place r of every block see

    y[s m + r] = sum over k of w[k] x[m + d],  d = (r + p - k) / s where that is whole

so each place has a small kernel of its own on the grid of x: one convolution gives the channels of
all places, DepthToSpace puts them side by side. The sums are those of onnxruntime's blocked
convolutions, whose bits do not depend on the window.
"""

from typing import Any

import numpy as np

from camkit.export.foreign.draft import Array, Draft, attributes_of, make_node


def replace_transposed(draft: Draft) -> None:
    """Replace every transposed convolution that keeps whole blocks, in place."""
    for node in list(draft.nodes):
        if node.op_type != "ConvTranspose" or node.input[1] not in draft.constants:
            continue
        attributes, weight = attributes_of(node), draft.constants[node.input[1]]
        strides = attributes.get("strides", [1, 1])
        if not _keeps_blocks(attributes, weight, strides):
            continue
        block, pads = strides[0], attributes.get("pads", [0] * 4)
        rows, columns = (_taps(weight.shape[2 + i], block, pads[i]) for i in range(2))
        kernel = _kernel(weight, block, (rows, columns))
        deep = draft.name("deep")
        inputs = [node.input[0], draft.constant(kernel)]
        if len(node.input) > 2 and node.input[2]:
            inputs.append(draft.constant(np.repeat(draft.constants[node.input[2]], block**2)))
        spans = [(min(t), max(t)) for t in (_offsets(rows), _offsets(columns))]
        conv = make_node(
            "Conv",
            inputs,
            deep,
            kernel_shape=list(kernel.shape[2:]),
            pads=[-spans[0][0], -spans[1][0], spans[0][1], spans[1][1]],
        )
        fine = make_node("DepthToSpace", [deep], node.output[0], blocksize=block, mode="CRD")
        draft.replace([node], [conv, fine])
    draft.prune()


Taps = dict[tuple[int, int], int]
"""(place in a block, tap of the kernel) -> offset of the sample that it sees."""


def _keeps_blocks(attributes: dict[str, Any], weight: Array, strides: list[int]) -> bool:
    """Return whether the output has whole blocks for every sample, and one group."""
    pads, growth = attributes.get("pads", [0] * 4), attributes.get("output_padding", [0, 0])
    plain = (
        attributes.get("group", 1) == 1
        and attributes.get("dilations", [1, 1]) == [1, 1]
        and attributes.get("auto_pad", "NOTSET") == "NOTSET"
        and "output_shape" not in attributes
        and weight.ndim == 4
    )
    return plain and all(
        strides[i] == strides[0]
        and weight.shape[2 + i] - pads[i] - pads[i + 2] + growth[i] == strides[0] > 1
        for i in range(2)
    )


def _taps(size: int, block: int, pad: int) -> Taps:
    return {
        (place, tap): (place + pad - tap) // block
        for place in range(block)
        for tap in range(size)
        if (place + pad - tap) % block == 0
    }


def _offsets(taps: Taps) -> list[int]:
    """Return the offsets that occur, and 0."""
    return [0, *taps.values()]


def _kernel(weight: Array, block: int, taps: tuple[Taps, Taps]) -> Array:
    """Return (outputs * block^2, inputs, h, w) of (inputs, outputs, k, k)."""
    inputs, outputs = weight.shape[:2]
    starts = [min(_offsets(one)) for one in taps]
    sides = [max(_offsets(one)) - start + 1 for one, start in zip(taps, starts, strict=True)]
    kernel = np.zeros((outputs, block, block, inputs, *sides), weight.dtype)
    for (y, i), down in taps[0].items():
        for (x, j), right in taps[1].items():
            kernel[:, y, x, :, down - starts[0], right - starts[1]] = weight[:, :, i, j].T
    return kernel.reshape(outputs * block**2, inputs, *sides)

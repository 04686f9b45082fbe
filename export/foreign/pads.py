"""Pads: of zeros into the convolution behind them, others with the pads of all axes stated."""

from typing import Any, Final

import numpy as np

from camkit.export.foreign.draft import Draft, attributes_of, make_node, scalar

_NDIM: Final = 4


def fold_pads(draft: Draft) -> None:
    """Rewrite every Pad of a draft, in place."""
    for node in list(draft.nodes):
        if node.op_type != "Pad":
            continue
        pads = _pads(draft, node)
        if pads is None:
            continue
        if _is_zero(draft, node) and _into_convolutions(draft, node, pads):
            continue
        inputs = [node.input[0], draft.constant(np.array(pads, np.int64))]
        if len(node.input) > 2 and node.input[2]:
            inputs.append(node.input[2])
        mode = attributes_of(node).get("mode", "constant")
        draft.replace([node], [make_node("Pad", inputs, node.output[0], mode=mode)])
    draft.prune()


def _pads(draft: Draft, node: Any) -> list[int] | None:
    """Return the pads of all axes, those before first; None where they are not constant."""
    values = draft.constants.get(node.input[1]) if len(node.input) > 1 else None
    if values is None:
        return None
    pads = [int(value) for value in values.ravel()]
    if len(node.input) > 3 and node.input[3]:
        axes = draft.constants.get(node.input[3])
        if axes is None:
            return None
        whole = [0] * (2 * _NDIM)
        for place, axis in enumerate(int(a) % _NDIM for a in axes.ravel()):
            whole[axis], whole[axis + _NDIM] = pads[place], pads[place + axes.size]
        pads = whole
    return pads if len(pads) == 2 * _NDIM else None


def _is_zero(draft: Draft, node: Any) -> bool:
    if attributes_of(node).get("mode", "constant") != "constant":
        return False
    if len(node.input) < 3 or not node.input[2]:
        return True
    return scalar(draft.constants, node.input[2]) == 0.0


def _into_convolutions(draft: Draft, node: Any, pads: list[int]) -> bool:
    """Add pads to those of the convolutions that read them; returns whether all could take them."""
    readers = draft.readers(node.output[0])
    spatial = [pads[2], pads[3], pads[6], pads[7]]
    plain = sum(map(abs, pads)) == sum(spatial) and min(spatial) >= 0
    fits = all(
        reader.op_type == "Conv"
        and reader.input[0] == node.output[0]
        and attributes_of(reader).get("auto_pad", "NOTSET") in ("NOTSET", "VALID")
        for reader in readers
    )
    if not (plain and fits and readers) or node.output[0] == draft.target:
        return False
    for reader in readers:
        attributes = attributes_of(reader)
        attributes.pop("auto_pad", None)
        old = attributes.pop("pads", [0] * 4)
        inputs = [node.input[0], *reader.input[1:]]
        new = make_node("Conv", inputs, reader.output[0], **attributes)
        new.attribute.extend(
            make_node(
                "Conv", [], "", pads=[a + b for a, b in zip(old, spatial, strict=True)]
            ).attribute
        )
        draft.replace([reader], [new])
    draft.nodes.remove(node)
    return True

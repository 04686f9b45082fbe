"""Reshape, Transpose, Reshape as the one node that they stand for: blocks of pixels and channels.

    (c b b, h, w) -> (c, b, b, h, w) -> (c, h, b, w, b) -> (c, h b, w b)    DepthToSpace
    (c, h b, w b) -> (c, h, b, w, b) -> (c, b, b, h, w) -> (c b b, h, w)    SpaceToDepth

In the order of torch the channels of a picture lie apart (c b b); SpaceToDepth has them together
(b b c), so a 1x1 convolution sorts them behind it where there are several.
"""

from typing import Any, Final

import numpy as np

from camkit.export.foreign.draft import Draft, attributes_of, make_node

_MODES: Final = {"CRD": ([0, 1, 4, 2, 5, 3], (1, 2, 2)), "DCR": ([0, 3, 4, 1, 5, 2], (2, 2, 1))}
"""Of DepthToSpace -> order of the Transpose, and which of its axes are channels and blocks."""
_UNSHUFFLE: Final[dict[tuple[int, ...], str]] = {
    (0, 1, 3, 5, 2, 4): "apart",
    (0, 3, 5, 1, 2, 4): "together",
}


def join_shuffles(draft: Draft) -> None:
    """Replace every such triple, in place."""
    for first in list(draft.nodes):
        if first.op_type != "Reshape" or first not in draft.nodes:
            continue
        turn = draft.only_reader(first.output[0])
        if turn is None or turn.op_type != "Transpose":
            continue
        last = draft.only_reader(turn.output[0])
        if last is None or last.op_type != "Reshape":
            continue
        names = (first.input[0], first.output[0], last.output[0])
        if any(name not in draft.shapes for name in names):
            continue
        new = _shuffle(draft, names, list(attributes_of(turn).get("perm", [])))
        if new:
            draft.replace([first, turn, last], new)
    draft.prune()


def _shuffle(draft: Draft, names: tuple[str, str, str], order: list[int]) -> list[Any]:
    """Return the nodes that stand for a triple; none if it is another one."""
    source, split, result = (draft.shapes[name] for name in names)
    if any(len(shape) != 4 for shape in (*source, *result)) or any(len(s) != 6 for s in split):
        return []
    if result[0][2] > source[0][2]:
        return _to_space(names, order, (source, split, result))
    return _to_depth(draft, names, order, (source, split, result))


def _to_space(names: tuple[str, str, str], order: list[int], shapes: Any) -> list[Any]:
    source, split, result = shapes
    block = result[0][2] // source[0][2]
    for mode, (turn, _) in _MODES.items():
        fits = all(
            shape == (g[0], *_split_channels(mode, g[1], block), *g[2:])
            and m == (g[0], g[1] // block**2, g[2] * block, g[3] * block)
            for g, shape, m in zip(source, split, result, strict=True)
        )
        if fits and order == turn:
            node = make_node("DepthToSpace", [names[0]], names[2], blocksize=block, mode=mode)
            return [node]
    return []


def _split_channels(mode: str, channels: int, block: int) -> tuple[int, int, int]:
    groups = channels // block**2
    return (groups, block, block) if mode == "CRD" else (block, block, groups)


def _to_depth(
    draft: Draft, names: tuple[str, str, str], order: list[int], shapes: Any
) -> list[Any]:
    source, split, result = shapes
    block = source[0][2] // max(result[0][2], 1)
    fits = block > 1 and all(
        shape == (g[0], g[1], g[2] // block, block, g[3] // block, block)
        and m == (g[0], g[1] * block**2, g[2] // block, g[3] // block)
        for g, shape, m in zip(source, split, result, strict=True)
    )
    kind = _UNSHUFFLE.get(tuple(order))
    if not fits or kind is None:
        return []
    channels = source[0][1]
    if kind == "together" or channels == 1:
        return [make_node("SpaceToDepth", [names[0]], names[2], blocksize=block)]
    deep = draft.name("deep")
    draft.shapes[deep] = result
    # (b b c) -> (c b b)
    places = np.arange(channels * block**2).reshape(block**2, channels).T.ravel()
    weight = np.eye(places.size, dtype=np.float32)[places][:, :, None, None]
    return [
        make_node("SpaceToDepth", [names[0]], deep, blocksize=block),
        make_node("Conv", [deep, draft.constant(weight)], names[2], kernel_shape=[1, 1]),
    ]

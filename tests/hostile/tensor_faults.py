"""Faults of safetensors: headers that lie, tensors of odd shapes, types and values."""

import json
import struct
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from safetensors.numpy import load, save

from tests.hostile.decisions import Decisions
from tests.hostile.json_faults import changed_json

_TYPES = ("f2", "f4", "f8", "u1", "u2", "u4", "i4", "i8", "?")
_SHAPES = ((1, 1), (1, 1, 1), (3, 1, 1), (2, 3), (0, 3), (1, 900))
_ODD = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e38, 1e-38, 65504.0, 1e300)


def changed_file(data: bytes, choose: Decisions) -> bytes:
    """Give a safetensors file with a changed header."""
    size = struct.unpack("<Q", data[:8])[0]
    header, rest = json.loads(data[8 : 8 + size]), data[8 + size :]
    text = changed_json(header, choose)
    stated = len(text) if choose.index(6) else choose.pick((0, 1, 2**40, 2**63, len(text) + 9))
    return struct.pack("<Q", stated % 2**64) + text + rest


def changed_tensors(data: bytes, choose: Decisions) -> bytes:
    """Give a sound safetensors file of changed tensors."""
    tensors = dict(load(data))
    for _ in range(1 + choose.index(3)):
        name = choose.pick(sorted(tensors))
        tensors[name] = _changed(tensors[name], choose)
        match choose.index(10):
            case 1:
                tensors[choose.pick(("a", "a.b", "typical.output", "x.capture", "é.reference"))] = (
                    tensors[name]
                )
            case 2:
                del tensors[name]
                if not tensors:
                    break
            case _:
                pass
    return bytes(save({name: np.ascontiguousarray(array) for name, array in tensors.items()}))


def _changed(array: Any, choose: Decisions) -> Any:
    with np.errstate(all="ignore"):
        return choose.pick(_CHANGES)(array, choose)


def _sliced(array: Any, choose: Decisions) -> Any:
    if not array.ndim:
        return array
    axis = choose.index(array.ndim)
    return array.take(range(choose.index(array.shape[axis] + 1)), axis=axis)


def _repeated(array: Any, choose: Decisions) -> Any:
    if not array.ndim:
        return array
    return np.repeat(array, choose.pick((2, 3, 5)), axis=choose.index(array.ndim))


def _with_odd_value(array: Any, choose: Decisions) -> Any:
    made = np.array(array)
    if made.size:
        value = np.float64(choose.pick(_ODD)).astype(made.dtype)
        made.reshape(-1)[choose.index(made.size)] = value
    return made


def _scaled(array: Any, choose: Decisions) -> Any:
    return (array * np.float64(choose.pick((0, -1, 2, 1e6, 1e-9)))).astype(array.dtype)


_CHANGES: Final[tuple[Callable[[Any, Decisions], Any], ...]] = (
    *(_sliced, _repeated, _with_odd_value, _scaled),
    lambda array, choose: array.astype(choose.pick(_TYPES)),
    lambda array, _: array.reshape(-1),
    lambda array, _: array[None],
    lambda array, _: np.zeros((), array.dtype),
    lambda _, choose: np.ones(choose.pick(_SHAPES), "f4"),
)

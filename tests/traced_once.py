"""Networks of one structure traced once in a process, with the weights of each; to import.

Tracing takes more than a second, of whatever size a network is. What the product does next stays:
it holds every graph against its network. `tests/export/test_onnx_graph.py` traces as users do.
"""

from collections.abc import Iterator

import onnx
import pytest
from onnx import numpy_helper
from torch import nn

from camkit.export import onnx_graph

_TRACED: dict[tuple[object, ...], onnx.ModelProto] = {}
_honest = onnx_graph._traced


def _remembered(network: nn.Module, channels: int, stride: int) -> onnx.ModelProto:
    weights = {name: value.detach().numpy() for name, value in network.state_dict().items()}
    shapes = tuple((name, value.shape) for name, value in weights.items())
    key = (type(network), str(network), shapes, channels, stride)
    if key not in _TRACED:
        _TRACED[key] = _honest(network, channels, stride)
    model = onnx.ModelProto()
    model.CopyFrom(_TRACED[key])
    for held in model.graph.initializer:
        if held.name in weights:
            held.CopyFrom(numpy_helper.from_array(weights[held.name], held.name))
    return model


@pytest.fixture(autouse=True, scope="module")
def traced_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(onnx_graph, "_traced", _remembered)
        yield

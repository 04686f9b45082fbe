"""A network of torch as its owner saved it: weights into a network, the network to ONNX.

a file -> weights, no code of it is run   (load_torch)
-> a network: a class that is named, a published one, or one that spandrel knows
-> ONNX                            (onnx_graph)
"""

import contextlib
import importlib
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import onnx
import torch
from torch import Tensor, nn

from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.export.foreign.onnx_file import ForeignModel, foreign_model
from camkit.export.foreign.published import published_network
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.torch_file import load_torch
from camkit.progress import note, working

_WRAPPERS: Final = ("params_ema", "params", "state_dict", "model_state_dict", "model", "net")
"""Keys under which trainers put the weights; averaged ones first."""
_PREFIXES: Final = ("module.", "_orig_mod.")
_STRIDES: Final = (1, 2, 4, 8, 16, 32, 64)
_MOST_NAMED: Final = 3
STRIDE: Final = "stride_px"
"""Attribute by which the exporter knows what divides the sides."""
_FAILURES: Final = (
    RuntimeError,
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    AssertionError,
    torch.onnx.OnnxExporterError,
)


def model_of_state_dict(path: Path, module: str | None, config: Mapping[str, Any]) -> ForeignModel:
    """Return the model of a file of torch.

    Args:
        path: Weights; nothing in the file is run.
        module: Class of the network, "package:Class"; None for one that is known by its keys.
        config: Arguments of that class.

    Raises:
        ContractError: If the file holds no weights, or they do not fit the class.
        DecodeError: If nobody knows the network.
        UnsupportedError: If torch cannot export it.
    """
    with working(f"loading {path.name}") as task:
        state = _weights(path)
        task.tell(f"loading {module or f'the network of {path.name}'}")
        network = _network(path, state, module, config)
        name, count = type(network).__name__, sum(weights.numel() for weights in state.values())
        note(f"{path.name}: {count:,} weights of {module or name}")
        task.tell(f"turning {name} into ONNX")
        channels = next((v.shape[1] for v in state.values() if v.ndim == 4), 0)
        return foreign_model(onnx.load_from_string(_exported(network, int(channels), path)))


def _weights(path: Path) -> dict[str, Tensor]:
    table = load_torch(path, "state dict")
    for key in _WRAPPERS:
        if isinstance(table, Mapping) and isinstance(table.get(key), Mapping):
            table = table[key]
            break
    if not isinstance(table, Mapping):
        table = {}
    state = {str(key): value for key, value in table.items() if isinstance(value, Tensor)}
    for prefix in _PREFIXES:
        if state and all(key.startswith(prefix) for key in state):
            state = {key.removeprefix(prefix): value for key, value in state.items()}
    if not state:
        raise ContractError(f"{path} holds no state dict; save network.state_dict() with torch")
    return {
        key: value.float() if value.is_floating_point() else value for key, value in state.items()
    }


def _network(
    path: Path, state: dict[str, Tensor], module: str | None, config: Mapping[str, Any]
) -> nn.Module:
    if module is not None:
        return _filled(_built(module, config), state, module)
    if config:
        raise ContractError(f"{option_text('config')} goes with {option_text('module')}")
    published = published_network(state)
    if published is not None:
        name, network, weights = published
        return _filled(network, weights, name)
    descriptor = spandrel_network(state)
    if descriptor is not None:
        return descriptor
    keys = ", ".join(list(state)[:_MOST_NAMED])
    raise DecodeError(
        f"{path} is a state dict of a network that is not known ({keys}, ...): name its class by "
        f"{option_text('module')} package:Class, or export it to ONNX"
    )


@contextlib.contextmanager
def _working_folder_searched() -> Iterator[None]:
    """Yield while modules are found in the working folder first, as by `python -m`."""
    folder = str(Path.cwd())
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)


def _built(module: str, config: Mapping[str, Any]) -> nn.Module:
    """Make the network of a class that the caller names.

    Raises:
        ContractError: If there is none, or it cannot be made.
    """
    package, colon, name = module.partition(":")
    if not (package and colon and name):
        raise ContractError(f"{option_text('module')} takes package:Class; got {module!r}")
    try:
        with _working_folder_searched():
            kind = getattr(importlib.import_module(package), name)
    except (ImportError, *_FAILURES) as error:
        raise ContractError(
            f"{module} cannot be imported from here or from the environment: "
            f"{type(error).__name__}: {error}"
        ) from error
    try:
        network = kind(**config)
    except _FAILURES as error:
        raise ContractError(
            f"{module} cannot be made of {dict(config)}: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(network, nn.Module):
        raise ContractError(f"{module} makes no torch network, but {type(network).__name__}")
    return network


def _filled(network: nn.Module, state: dict[str, Tensor], name: str) -> nn.Module:
    """Return a network with weights in it, all of them.

    Raises:
        ContractError: If names or shapes disagree.
    """
    expected = network.state_dict()
    missing = [key for key in expected if key not in state]
    extra = [key for key in state if key not in expected]
    shapes = [
        f"{key} {tuple(state[key].shape)} for {tuple(expected[key].shape)}"
        for key in expected
        if key in state and state[key].shape != expected[key].shape
    ]
    faults = {"missing": missing, "not in it": extra, "of another shape": shapes}
    texts = [
        f"{what}: {', '.join(keys[:_MOST_NAMED])}"
        + (f" and {len(keys) - _MOST_NAMED} more" if len(keys) > _MOST_NAMED else "")
        for what, keys in faults.items()
        if keys
    ]
    if texts:
        raise ContractError(f"the weights do not fit {name}: {'; '.join(texts)}")
    network.load_state_dict(state)
    return network.eval()


def spandrel_network(state: dict[str, Tensor]) -> nn.Module | None:
    """Return the network that spandrel (an extra, MIT) knows by its keys; None if it does not.

    Its extra architectures are never used: their licences differ.
    """
    try:
        import spandrel
    except (ImportError, RuntimeError):  # its torchvision need not load beside this torch
        return None
    try:
        descriptor = spandrel.ModelLoader(device="cpu").load_from_state_dict(state)
    except (spandrel.UnsupportedModelError, *_FAILURES):
        return None
    model: nn.Module = descriptor.model
    return model.eval()


def _exported(network: nn.Module, channels: int, path: Path) -> bytes:
    """Return the ONNX of a network by camkit's own exporter, at the least stride that does.

    Raises:
        UnsupportedError: If it cannot be exported.
    """
    declared = getattr(network, STRIDE, None)
    strides = _STRIDES if declared is None else (int(declared),)
    reason = ""
    for stride in strides:
        try:
            scale = _scale(network, channels, stride)
            setattr(network, STRIDE, stride)
            return to_onnx(network, channels=channels, scale=scale)
        except _FAILURES as error:
            reason = reason or f"{type(error).__name__} at {5 * stride} px"
    raise UnsupportedError(
        f"the network of {path} cannot be exported ({reason}; sides up to multiples of "
        f"{strides[-1]} px were tried): export it to ONNX yourself, with open height and width"
    )


def _scale(network: nn.Module, channels: int, stride: int) -> int:
    """Return the samples of the output for one of the input, tried on sides that nothing shares."""
    height, width = 5 * stride, 7 * stride
    with torch.no_grad():
        picture = network.eval()(torch.zeros(1, channels, height, width))
    scale = picture.shape[2] // height
    if picture.shape[2:] != (scale * height, scale * width):
        raise ValueError(f"{tuple(picture.shape)} of {height}x{width}")
    return int(scale)

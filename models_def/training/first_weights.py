"""First weights of a network: from a checkpoint, from a joint design, or from a finished bundle.

The ONNX of a bundle keeps the names of the lean networks' weights, so what was shipped can be
trained further.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.bundle.reader import SUFFIX, Bundle, find_bundle, open_bundle
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.errors import BundleError, ContractError
from camkit.models_def.networks.full_unet import FullUnet, start_from_trimmed
from camkit.models_def.training.checkpoint import State, read_table, recipe_of, to_checkpoint
from camkit.models_def.training.credits import FIRST_WEIGHTS

PRELU: Final = "_prelu"
"""End of the name of a node whose slope was a weight, which has no name of its own."""
# what an export computed beforehand; no weight
_CONSTANT: Final = re.compile(r"c\d+")


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstWeights:
    """Weights that somebody trained before.

    Attributes:
        source: Where they were read.
        whose: Camera and size, or the design.
        training_data: What they were trained on, in words.
        state: The weights.
    """

    source: str
    whose: str
    training_data: str
    state: State

    def credit(self, data: str) -> str:
        """Return the text for the card on the first weights; `data` is the training data since."""
        data_before = self.training_data
        if data and data_before.startswith(data):
            data_before = "the same" + data_before.removeprefix(data)
        once = f"{FIRST_WEIGHTS}{self.whose}, trained on the same"
        # parts of one training are told once
        return f"{FIRST_WEIGHTS}{self.whose}, trained on {data_before}".replace(once + once, once)


def read_first_weights(source: Path, size: str, role: str = DEFAULT_ROLE) -> FirstWeights:
    """Read first weights.

    Args:
        source: A checkpoint of `camkit train` or `camkit design`, a bundle, or the name of a
            built-in one.
        size: The network that will be trained; of a bundle with several, the one of that name.
        role: Its role.

    Raises:
        ContractError: If it is none of these, or holds no such network.
    """
    if source.suffix == SUFFIX or not (source.suffix or source.is_file()):
        return _of_bundle(open_bundle(find_bundle(source)), role, size)
    table = read_table(source)
    if "digest" in table:
        return _of_design(source, table)
    saved = to_checkpoint(source, table)
    return FirstWeights(
        source=str(source),
        whose=f"{recipe_of(saved).name} {saved.size}",
        training_data=saved.training_data,
        state=saved.exported,
    )


def take_first_weights(network: nn.Module, first: FirstWeights) -> tuple[str, ...]:
    """Return a network the first weights, in place.

    Args:
        network: The same network, or the full U-Net that extends a trimmed one.
        first: The weights.

    Returns:
        Names of the tensors that were copied.

    Raises:
        ContractError: If they are of another network.
    """
    if isinstance(network, FullUnet) and _fits(network.outer, first.state):
        return start_from_trimmed(network, first.state)
    if not _fits(network, first.state):
        raise ContractError(
            f"{first.source} ({first.whose}) holds another network than the recipe's: names or "
            "shapes of its weights differ (a full_unet may begin at a trimmed_unet of its widths)"
        )
    network.load_state_dict(first.state)
    return tuple(first.state)


def _fits(network: nn.Module, state: Mapping[str, Tensor]) -> bool:
    shapes = {name: tensor.shape for name, tensor in network.state_dict().items()}
    return shapes == {name: tensor.shape for name, tensor in state.items()}


def _of_design(source: Path, table: Mapping[str, Any]) -> FirstWeights:
    state = table.get("best", {}).get("network") or table.get("weights", {}).get("network")
    if not state:
        raise ContractError(f"{source} is a design without a network; there are no weights in it")
    return FirstWeights(
        source=str(source),
        whose=f"the joint design {source.stem}",
        training_data="pictures that its checkpoint does not name",
        state=state,
    )


def _of_bundle(bundle: Bundle, role: str, size: str) -> FirstWeights:
    sizes = tuple(bundle.manifest.networks.get(role, ()))
    if len(sizes) == 1:
        (size,) = sizes
    try:
        model = bundle.network_bytes(role, size)
    except BundleError as error:
        raise ContractError(str(error)) from error
    return FirstWeights(
        source=bundle.path.name,
        whose=f"{bundle.manifest.name} {size}",
        training_data=bundle.manifest.training_data,
        state=state_of_onnx(model),
    )


def state_of_onnx(model: bytes) -> State:
    """Return the weights of a network that `camkit export` wrote, under their names in torch.

    Raises:
        ContractError: If the network has PReLUs (the U-Nets of the thesis), or weights lie
            outside the model.
    """
    import onnx  # a run that is resumed does without

    graph = onnx.load_from_string(model).graph
    if any(node.name.endswith(PRELU) or node.op_type == "PRelu" for node in graph.node):
        raise ContractError(
            "the slopes of PReLUs lose their names on export; begin at the checkpoint of this "
            "network instead of its bundle"
        )
    state = {}
    for tensor in graph.initializer:
        if _CONSTANT.fullmatch(tensor.name) or tensor.data_type != onnx.TensorProto.FLOAT:
            continue
        if tensor.data_location == onnx.TensorProto.EXTERNAL:
            raise ContractError(f"the weight {tensor.name} lies in another file; refused")
        state[tensor.name] = torch.from_numpy(onnx.numpy_helper.to_array(tensor).copy())
    return state

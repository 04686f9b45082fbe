"""VGG-19 of torchvision: its layers, its files, and the features of conv1_2 ... conv5_2.

No weights come with camkit. A file is torchvision's state of `vgg19` (keys `features.0.weight` ...,
.pth or .safetensors); it is read without running code from it.

References: Simonyan and Zisserman 2015.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from camkit.errors import ContractError, DecodeError
from camkit.models_def.torch_file import load_torch
from camkit.regular_file import check_regular

MEAN: Final = (0.485, 0.456, 0.406)
DEVIATION: Final = (0.229, 0.224, 0.225)
WIDTHS: Final = (64, 128, 256, 512, 512)
BLOCK_STARTS: Final = (0, 5, 10, 19, 28)
"""First layer of each block in `features`; convolutions and ReLUs take turns behind it."""
BLOCK_CONVOLUTIONS: Final = (2, 2, 4, 4, 4)
TAPPED: Final = 2
"""conv1_2, conv2_2, ...: the second convolution of a block is what others look at."""
RANDOM_SEED: Final = 19

Pooling = Literal["average", "max"]


class VggLevels(nn.Module):
    """(b, 3, h, w) in 0..1 -> features behind the ReLU of conv1_2, conv2_2, ...; frozen.

    A new one has random weights, the same ones each time: good to try machinery, for nothing else.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(
        self,
        *,
        blocks: int = len(WIDTHS),
        widths: tuple[int, ...] = WIDTHS,
        pooling: Pooling = "average",
        next_one: bool = False,
    ) -> None:
        """Build the first blocks.

        Args:
            blocks: How many; the last ends at its second convolution.
            widths: Channels of each block; others than VGG's for tests.
            pooling: Between blocks. VGG was trained with max.
            next_one: Whether the convolution behind the last level is a level too, before its ReLU.

        Raises:
            ContractError: If there are no such blocks, or no such pooling.
        """
        super().__init__()
        if not 1 <= blocks <= len(widths) <= len(WIDTHS) or min(widths) < 1:
            raise ContractError(f"VGG-19 has 5 blocks of positive widths; got {blocks} of {widths}")
        if pooling not in ("average", "max"):
            raise ContractError(f"pooling must be average or max; got {pooling!r}")
        self.pool: nn.Module = nn.AvgPool2d(2) if pooling == "average" else nn.MaxPool2d(2)
        self.next_one = next_one
        self.blocks: list[list[str]] = []
        self.features = nn.ModuleDict()
        inputs = 3
        for block in range(blocks):
            count = TAPPED + next_one if block == blocks - 1 else BLOCK_CONVOLUTIONS[block]
            names = [str(BLOCK_STARTS[block] + 2 * i) for i in range(count)]
            self.blocks.append(names)
            for name in names:
                self.features[name] = nn.Conv2d(inputs, widths[block], 3, padding=1)
                inputs = widths[block]
        _draw_weights(self.features)
        for name, values in (("mean", MEAN), ("deviation", DEVIATION)):
            self.register_buffer(name, torch.tensor(values).reshape(1, 3, 1, 1), persistent=False)
        self.requires_grad_(requires_grad=False)

    def forward(self, picture: Tensor) -> tuple[Tensor, ...]:
        """Return the features, (b, widths[i], h / 2^i, w / 2^i)."""
        x = (picture - self.mean) / self.deviation
        raw = x
        levels: list[Tensor] = []
        for names in self.blocks:
            if levels:
                x = self.pool(x)
            for i, name in enumerate(names, start=1):
                raw = self.features[name](x)
                x = nn.functional.relu(raw)
                if i == TAPPED:
                    levels.append(x)
        return (*levels, raw) if self.next_one else tuple(levels)


def _draw_weights(layers: nn.Module) -> None:
    draw = torch.Generator().manual_seed(RANDOM_SEED)
    for layer in layers.modules():
        if isinstance(layer, nn.Conv2d):
            deviation = (2 / (9 * layer.in_channels)) ** 0.5
            nn.init.normal_(layer.weight, std=deviation, generator=draw)
            nn.init.zeros_(torch.as_tensor(layer.bias))


def take_vgg(network: nn.Module, path: Path) -> None:
    """Load the weights of a file into a network with the names of torchvision, in place.

    Raises:
        ContractError: If the file is missing, cannot be read as tensors alone, or lacks a tensor of
            torchvision's name and shape.
    """
    state = _read_tensors(path)
    expected = network.state_dict()
    for name, tensor in expected.items():
        stored = state.get(name)
        if not isinstance(stored, Tensor) or stored.shape != tensor.shape:
            got = "nothing" if stored is None else f"{tuple(getattr(stored, 'shape', ()))}"
            raise ContractError(
                f"{path.name} is no VGG-19 of torchvision (vgg19, not vgg19_bn): expected {name} "
                f"of shape {tuple(tensor.shape)}, got {got}"
            )
        if not bool(torch.isfinite(stored).all()):
            raise ContractError(f"{path.name}: {name} holds NaN or inf; fetch the file again")
    network.load_state_dict({name: state[name].float() for name in expected})


def file_digest(path: Path) -> str:
    """Return the sha256 of a file, to name weights by."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_tensors(path: Path) -> Mapping[str, Any]:
    try:
        if path.suffix == ".safetensors":
            check_regular(path)
            return load_file(path)
    except OSError as error:
        raise ContractError(f"cannot read {path}: {error.strerror}") from error
    except DecodeError as error:
        raise ContractError(f"cannot read {path}: {error}") from error
    except SafetensorError as error:
        raise ContractError(f"{path} holds no plain tensors: {error}") from error
    table = load_torch(path, "file of weights")
    if not isinstance(table, Mapping):
        raise ContractError(f"{path} must hold a table of tensors; got {type(table).__name__}")
    return table

"""VGG-19 up to conv3_3, with weights from a file that the user gives; none come with camkit.

The file is torchvision's state of `vgg19` (keys `features.0.weight` ..., .pth or .safetensors); it
is read without running code from it. Features are those before the ReLU of conv3_3, as in the
source that the thesis cites (layers 0..14 of `features`); the input is sRGB in 0..1, normalised
with the mean and deviation of ImageNet that torchvision states for these weights.

References: Simonyan and Zisserman 2015 (VGG); Johnson et al. 2016 (perceptual loss).
"""

import hashlib
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from camkit.errors import ContractError

MEAN: Final = (0.485, 0.456, 0.406)
DEVIATION: Final = (0.229, 0.224, 0.225)
# layer in `features`: (channels in, channels out); the others are ReLU, and pooling at 4 and 9
CONVOLUTIONS: Final = {
    0: (3, 64),
    2: (64, 64),
    5: (64, 128),
    7: (128, 128),
    10: (128, 256),
    12: (256, 256),
    14: (256, 256),
}
POOLINGS: Final = (4, 9)
LAST_LAYER: Final = 14


class VggFeatures(nn.Module):
    """(b, 3, h, w) sRGB in 0..1 -> (b, 256, h / 4, w / 4) features of conv3_3; frozen."""

    mean: Tensor
    deviation: Tensor

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for i in range(LAST_LAYER + 1):
            if i in CONVOLUTIONS:
                layers.append(nn.Conv2d(*CONVOLUTIONS[i], 3, padding=1))
            else:
                layers.append(nn.MaxPool2d(2) if i in POOLINGS else nn.ReLU())
        self.features = nn.Sequential(*layers)
        self.register_buffer("mean", torch.tensor(MEAN).reshape(1, 3, 1, 1), persistent=False)
        self.register_buffer(
            "deviation", torch.tensor(DEVIATION).reshape(1, 3, 1, 1), persistent=False
        )
        self.requires_grad_(requires_grad=False)

    def forward(self, picture: Tensor) -> Tensor:
        """Give the features; sides of the picture are at least 4."""
        features: Tensor = self.features((picture - self.mean) / self.deviation)
        return features


def read_vgg(path: Path) -> VggFeatures:
    """Read the weights and give the features.

    Raises:
        ContractError: If the file is missing, cannot be read as tensors alone, or lacks a tensor of
            torchvision's name and shape.
    """
    state = _read_tensors(path)
    network = VggFeatures()
    wanted = network.state_dict()
    for name, tensor in wanted.items():
        found = state.get(name)
        if not isinstance(found, Tensor) or found.shape != tensor.shape:
            got = "nothing" if found is None else f"{tuple(getattr(found, 'shape', ()))}"
            raise ContractError(
                f"{path.name} is no VGG-19 of torchvision (vgg19, not vgg19_bn): expected {name} "
                f"of shape {tuple(tensor.shape)}, got {got}"
            )
        if not bool(torch.isfinite(found).all()):
            raise ContractError(f"{path.name}: {name} holds NaN or inf; fetch the file again")
    network.load_state_dict({name: state[name].float() for name in wanted})
    return network.eval()


def file_digest(path: Path) -> str:
    """Give the sha256 of a file, to name weights by."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_tensors(path: Path) -> Mapping[str, Any]:
    try:
        if path.suffix == ".safetensors":
            return load_file(path)
        table = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise ContractError(f"cannot read {path}: {error.strerror}") from error
    except (SafetensorError, pickle.UnpicklingError, RuntimeError, EOFError) as error:
        raise ContractError(f"{path} holds no plain tensors: {error}") from error
    if not isinstance(table, Mapping):
        raise ContractError(f"{path} must hold a table of tensors; got {type(table).__name__}")
    return table

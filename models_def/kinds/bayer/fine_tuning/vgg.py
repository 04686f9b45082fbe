"""VGG-19 up to conv3_3, with weights from a file that the user gives; none come with camkit.

Features are those before the ReLU of conv3_3, as in the source that the thesis cites (layers 0..14
of `features`); the input is sRGB in 0..1, normalised with the mean and deviation of ImageNet that
torchvision states for these weights. The file: `camkit.models_def.networks.vgg`.

References: Simonyan and Zisserman 2015 (VGG); Johnson et al. 2016 (perceptual loss).
"""

from pathlib import Path
from typing import Final

import torch
from torch import Tensor, nn

from camkit.models_def.networks.vgg import DEVIATION, MEAN, take_vgg

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
        """Return the features; sides of the picture are at least 4."""
        features: Tensor = self.features((picture - self.mean) / self.deviation)
        return features


def read_vgg(path: Path) -> VggFeatures:
    """Read the weights and return the features.

    Raises:
        ContractError: If the file is missing, cannot be read as tensors alone, or lacks a tensor of
            torchvision's name and shape.
    """
    network = VggFeatures()
    take_vgg(network, path)
    return network.eval()

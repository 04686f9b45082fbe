"""Discriminators of fine-tuning; they are trained against, never exported.

    picture -- 4x4 /2 -- [4x4 /2, norm] x (layers - 1) -- 4x4, norm -- 4x4 -- map of scores

With 3 strided layers a score sees 70 pixels (the local one, PatchGAN); with 5 it sees 286, more
than a training patch (the global one). References: Isola et al. 2017 (PatchGAN); Kupyn et al. 2019
(DeblurGAN-v2: the pair, 3 and 5 layers); Sun 2021, section 6.2.2.

Instance norm looks at a whole picture and is not exact under tiling; no network that is exported
may have it.
"""

from dataclasses import dataclass

from torch import Tensor, nn

from camkit.errors import ContractError

SLOPE = 0.2
MOST_GROWTH = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscriminatorConfig:
    """Shape of a `Discriminator`.

    Attributes:
        layers: Strided layers: 3 local, 5 global.
        width: Channels of the first layer; they double per layer, up to 8 times.
    """

    layers: int
    width: int = 64

    def __post_init__(self) -> None:
        if self.layers < 1 or self.width < 1:
            raise ContractError(
                f"a discriminator needs layers and width >= 1; got {self.layers}, {self.width}"
            )


class Discriminator(nn.Module):
    """Scores of how real parts of a picture look."""

    def __init__(self, config: DiscriminatorConfig) -> None:
        super().__init__()
        self.config = config
        widths = [config.width * min(2**i, MOST_GROWTH) for i in range(config.layers + 1)]
        parts: list[nn.Module] = [_conv(3, widths[0], stride=2), nn.LeakyReLU(SLOPE)]
        for i in range(config.layers):
            stride = 2 if i < config.layers - 1 else 1
            parts += [
                _conv(widths[i], widths[i + 1], stride=stride),
                nn.InstanceNorm2d(widths[i + 1]),
                nn.LeakyReLU(SLOPE),
            ]
        self.layers = nn.Sequential(*parts, _conv(widths[-1], 1, stride=1))

    def forward(self, picture: Tensor) -> Tensor:
        """Return (b, 1, m, n) scores of (b, 3, h, w) pictures in 0..1."""
        scores: Tensor = self.layers(2 * picture - 1)
        return scores


def _conv(inputs: int, outputs: int, *, stride: int) -> nn.Conv2d:
    # Padding 2, as the cited source has it: no map ever shrinks to nothing.
    conv = nn.Conv2d(inputs, outputs, 4, stride, padding=2)
    nn.init.normal_(conv.weight, std=0.02)
    return conv

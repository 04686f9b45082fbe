"""Networks as others publish them, small and untrained, and their exports.

dncnn          residual noise of R, G, B; BatchNorm                       (Zhang 2017)
sid            U-Net on four packed planes, transposed convolutions       (Chen 2018)
nafnet         LayerNorm of channels, gates, pooled channel attention     (Chen 2022)
restormer      attention between channels, over the whole picture         (Zamir 2022)
normed_unet    reflecting pads, instance norms                            (DeblurGAN)
"""

import io
import logging
import warnings
from contextlib import redirect_stderr, redirect_stdout
from typing import Literal

import onnx
import torch
from torch import Tensor, nn
from torch.nn import functional

Exporter = Literal["dynamo", "legacy"]


class DnCNN(nn.Sequential):
    def __init__(self, depth: int = 4, width: int = 8, channels: int = 3) -> None:
        layers: list[nn.Module] = [nn.Conv2d(channels, width, 3, padding=1), nn.ReLU()]
        for _ in range(depth - 2):
            layers += [nn.Conv2d(width, width, 3, padding=1, bias=False)]
            layers += [nn.BatchNorm2d(width), nn.ReLU()]
        super().__init__(*layers, nn.Conv2d(width, channels, 3, padding=1))


class Sid(nn.Module):
    def __init__(self, width: int = 8) -> None:
        super().__init__()
        self.enter = self._pair(4, width)
        self.down = self._pair(width, 2 * width)
        self.up = nn.ConvTranspose2d(2 * width, width, 2, stride=2)
        self.join = self._pair(2 * width, width)
        self.last = nn.Conv2d(width, 12, 1)

    @staticmethod
    def _pair(inputs: int, outputs: int) -> nn.Sequential:
        return nn.Sequential(
            nn.Conv2d(inputs, outputs, 3, padding=1),
            nn.LeakyReLU(0.2),
            nn.Conv2d(outputs, outputs, 3, padding=1),
            nn.LeakyReLU(0.2),
        )

    def forward(self, x: Tensor) -> Tensor:
        fine = self.enter(x)
        coarse = self.down(functional.max_pool2d(fine, 2))
        joined = self.join(torch.cat([self.up(coarse), fine], 1))
        return functional.pixel_shuffle(self.last(joined), 2)


class LayerNorm2d(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: Tensor) -> Tensor:
        mean = x.mean(1, keepdim=True)
        variance = (x - mean).pow(2).mean(1, keepdim=True)
        y = (x - mean) / (variance + 1e-6).sqrt()
        return self.weight.view(1, -1, 1, 1) * y + self.bias.view(1, -1, 1, 1)


class NafBlock(nn.Module):
    def __init__(self, c: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(c, 2 * c, 1)
        self.conv2 = nn.Conv2d(2 * c, 2 * c, 3, padding=1, groups=2 * c)
        self.conv3 = nn.Conv2d(c, c, 1)
        self.sca = nn.Sequential(nn.AdaptiveAvgPool2d(1), nn.Conv2d(c, c, 1))
        self.conv4 = nn.Conv2d(c, 2 * c, 1)
        self.conv5 = nn.Conv2d(c, c, 1)
        self.norm1, self.norm2 = LayerNorm2d(c), LayerNorm2d(c)
        self.beta = nn.Parameter(torch.full((1, c, 1, 1), 0.5))
        self.gamma = nn.Parameter(torch.full((1, c, 1, 1), 0.5))

    @staticmethod
    def gate(x: Tensor) -> Tensor:
        first, second = x.chunk(2, dim=1)
        return first * second

    def forward(self, given: Tensor) -> Tensor:
        x = self.gate(self.conv2(self.conv1(self.norm1(given))))
        y = given + self.conv3(x * self.sca(x)) * self.beta
        return y + self.conv5(self.gate(self.conv4(self.norm2(y)))) * self.gamma


class NAFNet(nn.Module):
    """As published: keys of the state dict, and the pads to multiples of the deepest stride."""

    def __init__(
        self,
        img_channel: int = 3,
        width: int = 8,
        middle_blk_num: int = 1,
        enc_blk_nums: tuple[int, ...] = (1, 1),
        dec_blk_nums: tuple[int, ...] = (1, 1),
    ) -> None:
        super().__init__()
        self.intro = nn.Conv2d(img_channel, width, 3, padding=1)
        self.ending = nn.Conv2d(width, img_channel, 3, padding=1)
        self.encoders, self.decoders = nn.ModuleList(), nn.ModuleList()
        self.ups, self.downs = nn.ModuleList(), nn.ModuleList()
        channels = width
        for count in enc_blk_nums:
            self.encoders.append(nn.Sequential(*[NafBlock(channels) for _ in range(count)]))
            self.downs.append(nn.Conv2d(channels, 2 * channels, 2, 2))
            channels *= 2
        self.middle_blks = nn.Sequential(*[NafBlock(channels) for _ in range(middle_blk_num)])
        for count in dec_blk_nums:
            self.ups.append(
                nn.Sequential(nn.Conv2d(channels, 2 * channels, 1, bias=False), nn.PixelShuffle(2))
            )
            channels //= 2
            self.decoders.append(nn.Sequential(*[NafBlock(channels) for _ in range(count)]))
        self.padder_size = 2 ** len(self.encoders)

    def forward(self, given: Tensor) -> Tensor:
        height, width = given.shape[2:]
        rows, columns = (-side % self.padder_size for side in (height, width))
        inp = functional.pad(given, (0, columns, 0, rows))
        x = self.intro(inp)
        skips = []
        for encoder, down in zip(self.encoders, self.downs, strict=True):
            x = encoder(x)
            skips.append(x)
            x = down(x)
        x = self.middle_blks(x)
        for decoder, up, skip in zip(self.decoders, self.ups, skips[::-1], strict=True):
            x = decoder(up(x) + skip)
        return (self.ending(x) + inp)[:, :, :height, :width]


class Mdta(nn.Module):
    """Multi-Dconv head transposed attention: channels attend to channels."""

    def __init__(self, c: int = 8, heads: int = 2) -> None:
        super().__init__()
        self.heads = heads
        self.temperature = nn.Parameter(torch.ones(heads, 1, 1))
        self.enter = nn.Conv2d(3, c, 3, padding=1)
        self.qkv = nn.Conv2d(c, 3 * c, 1)
        self.local = nn.Conv2d(3 * c, 3 * c, 3, padding=1, groups=3 * c)
        self.out = nn.Conv2d(c, 3, 1)

    def forward(self, x: Tensor) -> Tensor:
        y = self.enter(x)
        b, c, h, w = y.shape
        q, k, v = (
            part.reshape(b, self.heads, c // self.heads, h * w)
            for part in self.local(self.qkv(y)).chunk(3, dim=1)
        )
        q, k = functional.normalize(q, dim=-1), functional.normalize(k, dim=-1)
        attention = ((q @ k.transpose(-2, -1)) * self.temperature).softmax(dim=-1)
        return x + self.out((attention @ v).reshape(b, c, h, w))


class NormedUnet(nn.Module):
    def __init__(self, width: int = 8) -> None:
        super().__init__()
        self.enter = nn.Sequential(
            nn.ReflectionPad2d(3), nn.Conv2d(3, width, 7), nn.InstanceNorm2d(width), nn.ReLU()
        )
        self.down = nn.Sequential(
            nn.Conv2d(width, 2 * width, 3, stride=2, padding=1),
            nn.InstanceNorm2d(2 * width),
            nn.ReLU(),
        )
        self.block = nn.Sequential(
            nn.ReflectionPad2d(1), nn.Conv2d(2 * width, 2 * width, 3), nn.InstanceNorm2d(2 * width)
        )
        self.up = nn.ConvTranspose2d(2 * width, width, 3, stride=2, padding=1, output_padding=1)
        self.last = nn.Sequential(nn.ReflectionPad2d(3), nn.Conv2d(width, 3, 7), nn.Tanh())

    def forward(self, x: Tensor) -> Tensor:
        y = self.down(self.enter(x))
        y = y + self.block(y)
        return x + self.last(functional.relu(self.up(y)))


def seeded(network: type[nn.Module], seed: int = 1, **config: object) -> nn.Module:
    """Return a network with random weights and, where it has them, statistics as if trained."""
    torch.manual_seed(seed)
    made = network(**config)
    for module in made.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.uniform_(module.bias, -0.1, 0.1)
            nn.init.uniform_(module.running_mean, -0.1, 0.1)
            nn.init.uniform_(module.running_var, 0.5, 1.5)
    return made.eval()


def exported(
    network: nn.Module,
    exporter: Exporter = "dynamo",
    *,
    channels: int = 3,
    opset: int = 20,
    half: bool = False,
    fixed: bool = False,
) -> bytes:
    """Return the ONNX of a network, with height and width open unless fixed."""
    made = network.half() if half else network
    example = torch.zeros(1, channels, 32, 40, dtype=torch.float16 if half else torch.float32)
    axes = None
    shapes: object = None
    if not fixed and exporter == "legacy":
        axes = {"image": {0: "n", 2: "h", 3: "w"}, "restored": {0: "n", 2: "h", 3: "w"}}
    elif not fixed:
        height, width = (torch.export.Dim(name, min=2, max=4096) for name in ("h", "w"))
        shapes = ({2: 8 * height, 3: 8 * width},)
    stream = io.BytesIO()
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")
        if exporter == "legacy":
            torch.onnx.export(
                made, (example,), stream, dynamo=False, opset_version=opset,
                input_names=["image"], output_names=["restored"], dynamic_axes=axes,
            )  # fmt: skip
            return stream.getvalue()
        program = torch.onnx.export(
            made, (example,), dynamo=True, opset_version=opset,
            input_names=["image"], output_names=["restored"], dynamic_shapes=shapes, verbose=False,
        )  # fmt: skip
    proto: onnx.ModelProto = program.model_proto
    return proto.SerializeToString()

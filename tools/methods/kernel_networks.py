"""Networks that know the blur: features deconvolved by Wiener, and splitting unrolled.

    blurred block, transfer --> convolutions per colour --> Wiener --> small U-Net     FeatureWiener
                            --> closed form, small U-Net, closed form, ...             UnrolledHqs
                            --> closed form, S at half size, closed form, S            TwoStages

They see a block as the bank does: linear, white balanced, tapered to be periodic, with the kernels
of its place. What they give is stabilised, as of every network of camkit. No bundle holds one, so
they serve the front of methods alone.

References: Dong, Roth, Schiele 2020, Deep Wiener Deconvolution (features); Geman, Yang 1995
(half-quadratic splitting); Zhang et al. 2020 (unrolled, a network as prior).
"""

from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor, nn

from camkit.models_def.networks.lean_unet import LEAN_S, LeanUnet
from camkit.models_def.sensors.stabilise import unstabilise
from camkit.models_def.sensors.wiener import LEAST_POWER

LEAST_ELECTRONS: Final = 0.25
"""Below it the square root is flat: its slope must stay finite."""
FEATURE_PX: Final = 7
FEATURES: Final = 8
"""Of every colour; the first is the plane itself."""
STEPS: Final = 3
FIRST_TRUST: Final = 3.0
"""Logarithm of the first weight of a prior, in the ratio of noise to signal; falls by 1 a step."""
STAGE: Final = replace(LEAN_S, bias=True)
PRIOR: Final = replace(STAGE, in_channels=3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blurred:
    """Blocks of one size, each with the blur of its place.

    Attributes:
        planes: (b, 3, h, w) linear, periodic.
        otf: (b, 3, h, w // 2 + 1).
        shot: (b, 3) variance per unit of signal.
        read_variance: (b, 3).
        scale: Divisor of the stabilising transform.
    """

    planes: Tensor
    otf: Tensor
    shot: Tensor
    read_variance: Tensor
    scale: float

    @property
    def size(self) -> tuple[int, int]:
        """Return (h, w)."""
        return self.planes.shape[-2], self.planes.shape[-1]

    @property
    def level(self) -> Tensor:
        """Return (b, 3, 1, 1): the mean of a block, at least its read noise."""
        mean = self.planes.mean((-2, -1)).clamp(min=0)
        level: Tensor = torch.maximum(mean.square(), self.read_variance).clamp(min=LEAST_POWER)
        return level.sqrt()[..., None, None]

    @property
    def variance(self) -> Tensor:
        """Return (b, 3, 1, 1) of the noise at the mean of a block."""
        mean = self.planes.mean((-2, -1)).clamp(min=0)
        return (self.shot * mean + self.read_variance)[..., None, None]

    @property
    def noise_ratio(self) -> Tensor:
        """Return (b, 3, 1, 1): the variance of the noise over the square of the level."""
        return self.variance / self.level.square()

    def stabilised(self, planes: Tensor) -> Tensor:
        """Return planes taken to equal noise; with a slope where there is no light."""
        shot, read = self.shot[..., None, None], self.read_variance[..., None, None]
        electrons = planes / shot + read / shot.square()
        return electrons.clamp(min=LEAST_ELECTRONS).sqrt() / self.scale

    def linear(self, stable: Tensor) -> Tensor:
        """Undo `stabilised`."""
        return unstabilise(stable, self.shot, self.read_variance, scale=self.scale)


def closed_form(spectrum: Tensor, otf: Tensor, prior: Tensor, weight: Tensor) -> Tensor:
    """Return the x with the least |h * x - y|^2 + weight |x - prior|^2.

    Args:
        spectrum: (b, c, h, w // 2 + 1) of y.
        otf: Of h, likewise.
        prior: (b, c, h, w).
        weight: (b, c, 1, 1).
    """
    size = (prior.shape[-2], prior.shape[-1])
    power = otf.real.square() + otf.imag.square()
    solved = (otf.conj() * spectrum + weight * torch.fft.rfft2(prior)) / (power + weight)
    sharp: Tensor = torch.fft.irfft2(solved, s=size)
    return sharp


class UnrolledHqs(nn.Module):
    """Half-quadratic splitting with a few steps; priors and their weights are learned."""

    stride_px = LeanUnet(PRIOR).stride_px

    def __init__(self, steps: int = STEPS) -> None:
        super().__init__()
        falling = torch.arange(FIRST_TRUST, FIRST_TRUST - steps, -1.0)
        self.trust = nn.Parameter(falling[:, None].repeat(1, 3))
        self.priors = nn.ModuleList(LeanUnet(PRIOR) for _ in range(steps))

    def forward(self, blurred: Blurred) -> Tensor:
        """Return (b, 3, h, w), stabilised."""
        ratio = blurred.noise_ratio
        spectrum, linear = torch.fft.rfft2(blurred.planes), blurred.planes
        stable = linear
        for number, prior in enumerate(self.priors):
            weight = self.trust[number].exp()[:, None, None] * ratio
            sharp = closed_form(spectrum, blurred.otf, linear, weight)
            stable = prior(blurred.stabilised(sharp)).float()
            linear = blurred.linear(stable)
        return stable


class TwoStages(nn.Module):
    """S at half size, a closed-form step that takes its picture for what to expect, and S again."""

    stride_px = 2 * LeanUnet(STAGE).stride_px

    def __init__(self) -> None:
        super().__init__()
        self.trust = nn.Parameter(
            torch.tensor([FIRST_TRUST, FIRST_TRUST - 1])[:, None].repeat(1, 3)
        )
        self.first, self.second = LeanUnet(STAGE), LeanUnet(STAGE)

    def forward(self, blurred: Blurred) -> Tensor:
        """Return (b, 3, h, w), stabilised."""
        spectrum = torch.fft.rfft2(blurred.planes)
        weight = self.trust.exp()[..., None, None] * blurred.noise_ratio[:, None]
        capture = blurred.stabilised(blurred.planes)
        sharp = closed_form(spectrum, blurred.otf, blurred.planes, weight[:, 0])
        halves = torch.cat([capture, blurred.stabilised(sharp)], dim=1)
        coarse = self.first(nn.functional.avg_pool2d(halves, 2)).float()
        whole = nn.functional.interpolate(coarse, scale_factor=2, mode="bilinear")
        sharp = closed_form(spectrum, blurred.otf, blurred.linear(whole), weight[:, 1])
        planes = torch.cat([capture, blurred.stabilised(sharp)], dim=1)
        restored: Tensor = self.second(planes).float()
        return restored


class FeatureWiener(nn.Module):
    """Wiener on features of every colour, each with its own ratio of noise to signal."""

    stride_px = UnrolledHqs.stride_px

    def __init__(self, features: int = FEATURES) -> None:
        super().__init__()
        self.features = features
        self.filters = nn.Parameter(0.05 * torch.randn(3, features - 1, FEATURE_PX, FEATURE_PX))
        self.ratio = nn.Parameter(torch.full((3 * features,), 1.0))
        self.refine = LeanUnet(PRIOR)
        width = PRIOR.widths[0]
        self.refine.head = nn.Conv2d(3 * features + 6, width, 6, 2, 2)

    def forward(self, blurred: Blurred) -> Tensor:
        """Return (b, 3, h, w), stabilised."""
        features, noise_gain = self._features(blurred.planes / blurred.level)
        batch, height, width = len(features), *blurred.size
        noise = blurred.noise_ratio.repeat_interleave(self.features, 1)
        noise = noise * noise_gain[:, None, None]
        power = features.var((-2, -1), keepdim=True).clamp(min=LEAST_POWER)
        otf = blurred.otf.repeat_interleave(self.features, 1)
        nsr = self.ratio.exp()[:, None, None] * noise / power
        spectrum = torch.fft.rfft2(features) * otf.conj()
        spectrum = spectrum / (otf.real.square() + otf.imag.square() + nsr)
        sharp = torch.fft.irfft2(spectrum, s=blurred.size)
        sharp = sharp.reshape(batch, 3, self.features, height, width)
        base = blurred.stabilised(sharp[:, :, 0] * blurred.level)
        # the slope of the stabilising transform at the level of the block
        at_level = blurred.stabilised(blurred.level)
        slope = blurred.level / (2 * blurred.shot[..., None, None] * blurred.scale**2 * at_level)
        equal = (sharp * slope[:, :, None]).flatten(1, 2)
        planes = torch.cat([equal, blurred.stabilised(blurred.planes), base], dim=1)
        restored: Tensor = self.refine(planes).float()
        return restored

    def _features(self, planes: Tensor) -> tuple[Tensor, Tensor]:
        """Return (b, 3 n, h, w), periodic, and by how much each raises the variance of noise."""
        middle = FEATURE_PX // 2
        whole = torch.zeros(3, 1, FEATURE_PX, FEATURE_PX, dtype=planes.dtype)
        whole[:, :, middle, middle] = 1
        filters = torch.cat([whole, self.filters], dim=1).flatten(0, 1)
        padded = nn.functional.pad(planes, (middle,) * 4, mode="circular")
        with torch.autocast("cpu", enabled=False):
            features = nn.functional.conv2d(padded, filters[:, None], groups=3)
        return features, filters.square().sum((-2, -1))

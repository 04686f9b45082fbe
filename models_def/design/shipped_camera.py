"""A camera that ships, in a design loop: its sensor, its bank, and what follows its network.

    sharp Rec.709 -> camera colours -> blur -> noise of an ISO -> mosaic, demosaic -> bank that
    restores the colours together -> stabilised -> network -> bound of its light -> sRGB tone

All of it is what the samples of training go through, with gradients to the kernels. What the bank
knows of a lens is its nominal kernels and V, the variance of the transfer over Monte-Carlo
samples. A lens that moves has another V, so the loop measures it anew. V has no gradient: the
captures are made through such samples, which is where a lens pays for what fabrication costs it.
Lights that clip are not simulated; the runtime explains them before the filter.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.bundle.light_bound import BRIGHT
from camkit.bundle.stages import Together
from camkit.colorimetry import camera_from_rec709, rec709_from_camera
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.networks.light import bounded
from camkit.models_def.sensors.demosaic import demosaic, mosaic
from camkit.models_def.sensors.forward import blur
from camkit.models_def.sensors.stabilise import stabilise, unstabilise
from camkit.models_def.sensors.together import (
    Numbers,
    frequencies_squared,
    line_means,
    restore_doubting,
)
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.sensors.wiener import block_facts, to_otf
from camkit.models_def.training.recipe import mosaic_sensor

GRID_PX: Final = 256
LEAST_ELECTRONS_SQUARED: Final = 1e-4
"""Below it a square root has no slope that can be used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraChoice:
    """The camera of a design whose front restores colours together.

    The front `together` and this table belong together.

    Attributes:
        recipe: File of its training recipe, relative to the design recipe. `pitch_um` of
            `[pixels]` must be that of its sensor.
        iso: Least and greatest ISO value; drawn log-uniformly.
        copies: Monte-Carlo samples that the spread of the lens is measured with; 0 takes the
            table of the training recipe.
        spread_steps: Steps between measurements of that spread.
    """

    recipe: str
    iso: tuple[float, ...] = (100.0, 3200.0)
    copies: int = 8
    spread_steps: int = 25

    def __post_init__(self) -> None:
        if len(self.iso) != 2 or not 0 < self.iso[0] <= self.iso[1]:
            raise ContractError(f"camera.iso must be two increasing ISOs; got {list(self.iso)}")
        if self.copies < 0 or self.spread_steps < 1:
            raise ContractError(
                "camera.copies must be >= 0 and camera.spread_steps >= 1; got "
                f"{self.copies}, {self.spread_steps}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """The knowledge that a filter has of a lens.

    Attributes:
        kernels: (depth, field, 3, k, k), nominal.
        spread: (depth, field, 3, n) V around the frequencies of the recipe's table; None where
            the filter does not ask for it.
    """

    kernels: Tensor
    spread: Tensor | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """The noise of patches after white balance, (b, 3) each: shot, and variance at no light."""

    shot: Tensor
    read: Tensor


class Camera:
    """The sensor, the bank and the tone of a recipe."""

    def __init__(self, recipe: BayerRecipe, choice: CameraChoice, margin_px: int) -> None:
        """Read off the numbers of a recipe.

        Args:
            recipe: Of training.
            choice: Of the design.
            margin_px: Recorded around a patch for the filter and cut off again.

        Raises:
            ContractError: If its bank restores every colour alone, or its sensor has no mosaic.
        """
        if recipe.wiener.together is None:
            raise ContractError(
                f"the bank of {choice.recipe} restores every colour alone; state wiener.together "
                "(camkit fit-bank) or take the front 'wiener'"
            )
        self.recipe, self.choice, self.margin_px = recipe, choice, margin_px
        self.together: Together = recipe.wiener.together
        sensor = mosaic_sensor(recipe.sensor)
        self._cfa, matrix = sensor.cfa, np.array(sensor.color_matrix)
        to_camera, self.gains = camera_from_rec709(matrix)
        self._to_camera = torch.from_numpy(to_camera).float()
        self.to_rec709 = torch.from_numpy(rec709_from_camera(matrix)).float()

    def noise_at(self, places: Tensor) -> Noise:
        """Return the noise of patches; `places` (b,) 0..1 lie between the ISOs."""
        low, high = (math.log(iso) for iso in self.choice.iso)
        models = [
            self.recipe.sensor.noise_at(math.exp(low + place * (high - low))).with_gains(self.gains)
            for place in places.tolist()
        ]
        return Noise(
            shot=torch.tensor([model.shot for model in models]),
            read=torch.tensor([model.read_variance for model in models]),
        )

    def variance_at(self, iso: float, level: float) -> Tensor:
        """Return the variance (3,) of the noise of a level after white balance."""
        model = self.recipe.sensor.noise_at(iso).with_gains(self.gains)
        read = torch.tensor(model.read_variance, dtype=torch.float64)
        return read + level * torch.tensor(model.shot, dtype=torch.float64)

    def capture(self, sharp: Tensor, kernels: Tensor, noise: Noise, normal: Tensor) -> Tensor:
        """Photograph patches and develop them.

        Args:
            sharp: (b, 3, h + k - 1, w + k - 1) linear Rec.709.
            kernels: (b, 3, k, k).
            noise: Of the patches.
            normal: (b, 3, h, w) standard normal numbers.

        Returns:
            (b, 3, h, w) white-balanced camera colours.
        """
        light = blur(_turned(sharp, self._to_camera).clamp(min=0), kernels.to(sharp.dtype))
        variance = _columns(noise.shot) * light.detach() + _columns(noise.read)
        recorded = light + variance.clamp(min=0).sqrt() * normal
        return demosaic(mosaic(recorded, self._cfa), self._cfa)

    def restored(self, planes: Tensor, kernels: Tensor, spread: Tensor, noise: Noise) -> Tensor:
        """Return developed patches (b, 3, h, w) behind the bank, each a periodic block.

        Args:
            planes: As of `capture`.
            kernels: (b, 3, k, k), nominal.
            spread: (b, 3, n) V of their places.
            noise: Of the patches.
        """
        facts = block_facts(
            planes, kernels.to(planes.dtype), noise.shot, noise.read, self.recipe.wiener
        )
        f = frequencies_squared((planes.shape[-2], planes.shape[-1]), planes).sqrt()
        return restore_doubting(
            facts.planes,
            facts.otf,
            facts.level,
            facts.variance,
            _interpolated_lines(spread.to(planes.dtype), self.together.spread.frequencies, f),
            Numbers.of(self.together, planes),
        )

    def pictures(
        self, developed: Tensor, restored: Tensor, noise: Noise, network: nn.Module | None
    ) -> Tensor:
        """Return what the camera makes of patches, (b, 3, p, p) in sRGB tone.

        Args:
            developed: (b, 3, h, w), as of `capture`.
            restored: (b, 3, h, w), as of `restored`.
            noise: Of the patches.
            network: Takes both, stabilised; None leaves it at the bank.
        """
        scale = self.recipe.scale
        inner = slice(self.margin_px, -self.margin_px)
        capture, front = (self._stable(x[..., inner, inner], noise) for x in (developed, restored))
        output = front if network is None else network(torch.cat([capture, front], dim=1))
        if network is not None and self.recipe.light is not None:
            bright = BRIGHT**0.5 / (scale * noise.shot.sqrt())
            output = bounded(output, front, None, self.recipe.light, scale=scale, bright=bright)
        linear = unstabilise(output, noise.shot, noise.read, scale=scale)
        return encode_srgb(_turned(linear, self.to_rec709))

    def _stable(self, planes: Tensor, noise: Noise) -> Tensor:
        shot = _columns(noise.shot)
        least = (LEAST_ELECTRONS_SQUARED - _columns(noise.read) / shot.square()) * shot
        above = torch.maximum(planes, least)
        return stabilise(above, noise.shot, noise.read, scale=self.recipe.scale)

    def measured_spread(self, kernels: Tensor, copies: list[Tensor]) -> Tensor:
        """Return V (depth, field, 3, n) of Monte-Carlo samples against kernels that a filter has.

        Args:
            kernels: (depth or 1, field, 3, k, k).
            copies: (depth, field, 3, k, k) of each.
        """
        with torch.no_grad():
            frozen = _transfer(kernels)
            squares: Any = sum((_transfer(copy) - frozen).abs().square() for copy in copies)
        mean = squares.numpy().astype(np.float64) / len(copies)
        return torch.from_numpy(line_means(mean, self.together.spread.frequencies)).float()

    def stated_spread(self, heights_mm: Tensor) -> Tensor:
        """Return V (1, field, 3, n) of field heights, from the table of the recipe."""
        spread = self.together.spread
        table = np.array(spread.variance, np.float64)
        place = np.interp(heights_mm, spread.heights_mm, np.arange(len(table)))
        below = np.floor(place).astype(int)
        part = (place - below)[:, None, None]
        above = np.minimum(below + 1, len(table) - 1)
        return torch.from_numpy((1 - part) * table[below] + part * table[above]).float()[None]


def _interpolated_lines(lines: Tensor, frequencies: tuple[float, ...], f: Tensor) -> Tensor:
    """Return lines (..., n) at the places f (h, w), linear between frequencies, (..., h, w)."""
    places = torch.tensor(frequencies, dtype=f.dtype)
    at = f.clamp(max=places[-1])
    low = (torch.searchsorted(places, at.contiguous(), right=True) - 1).clamp(0, len(places) - 2)
    part = (at - places[low]) / (places[low + 1] - places[low])
    return lines[..., low] + part * (lines[..., low + 1] - lines[..., low])


def _transfer(kernels: Tensor) -> Tensor:
    lead = kernels.shape[:-3]
    otf = to_otf(kernels.flatten(0, -4), (GRID_PX, GRID_PX))
    return otf.reshape(*lead, *otf.shape[1:])


def _turned(planes: Tensor, matrix: Tensor) -> Tensor:
    return (matrix.to(planes.dtype) @ planes.flatten(2)).reshape(planes.shape)


def _columns(values: Tensor) -> Tensor:
    return values[..., None, None]

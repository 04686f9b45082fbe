"""Classical restorations of training samples, in place of the bank, for tables beside networks.

developed sample -> one block of the runtime, tapered -> RL, ADMM-TV, cross-channel -> its planes

They see what the bank sees: planes with surroundings, the kernels of their block, noise, clipped
pixels. Their numbers are those of `camkit process --method`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.frames.samples import TileMaker
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import Developed, filtered, finish_shot
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.training.kind import SampleMaker
from camkit.models_def.training.recipe import Recipe
from camkit.models_def.training.sample import Sample
from camkit.runtime.bank.baselines import block_filter
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf

Method = Callable[[Developed, BayerRecipe], Tensor]
"""A developed sample -> (1, 3, S, S), linear."""
BY_BLOCK: Final = ("rl", "admm-tv", "cross-channel")
METHODS: Final = ("wiener-alone", *BY_BLOCK)


def by_block(method: str) -> Method:
    """Return a method of the runtime (see `block_filter`) on a sample as one block."""

    def restore(developed: Developed, recipe: BayerRecipe) -> Tensor:
        shot, settings = developed.circumstances, recipe.wiener
        planes, kernels = developed.planes[0].numpy(), shot.frozen[0].numpy()
        otf = to_otf(kernels, planes.shape[-1])
        block = Block(
            samples=taper_edges(planes, otf, settings.overlap_px // 4),
            otf=otf,
            unknown=developed.unknown[0].numpy() if bool(developed.unknown.any()) else None,
            height_mm=shot.height_mm,
        )
        noise = shot.noise.raised(shot.noise_rise)
        restored = block_filter(method, settings, noise, kernels.shape[-1])(block)
        return torch.from_numpy(restored)[None]

    return restore


def wiener_alone(developed: Developed, recipe: BayerRecipe) -> Tensor:
    """Return what the bank makes of every colour for itself."""
    return filtered(developed, recipe.with_together(None))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassicalMaker:
    """Makes samples whose second planes are those of a method, not of the bank.

    Attributes:
        maker: Of the usual samples.
        recipe: Their camera.
        method: Restores.
    """

    maker: BayerMaker | TileMaker
    recipe: BayerRecipe
    method: Method

    def make(self, index: int) -> Sample:
        """Make sample i: the same capture."""
        developed = self.maker.developed(index)
        return finish_shot(developed, self.recipe, self.method(developed, self.recipe)).sample


def with_method(name: str, maker: SampleMaker, recipe: Recipe) -> SampleMaker:
    """Return a maker of the same samples by one of `METHODS`.

    Raises:
        ContractError: If the camera has no bank that could be replaced.
    """
    if not (isinstance(maker, BayerMaker | TileMaker) and isinstance(recipe, BayerRecipe)):
        raise ContractError(f"{name} is for cameras behind a mosaic; {recipe.name} is none")
    method = by_block(name) if name in BY_BLOCK else wiener_alone
    return ClassicalMaker(maker=maker, recipe=recipe, method=method)

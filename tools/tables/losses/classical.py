"""Classical restorations of training samples, in place of the bank, for tables beside networks.

developed sample -> one block of the runtime, tapered -> RL, ADMM-TV, cross-channel -> its planes

They see what the bank sees: planes with surroundings, the kernels of their block, noise, clipped
pixels. Their numbers are those of `camkit process --method`, tuned on pictures of another camera
(`camkit.runtime.bank.baselines`), or those that `tuned` finds on samples that networks learn from.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Final

import torch
from torch import Tensor

from camkit.contracts import NoiseModel
from camkit.models_def.kinds.bayer.frames.samples import TileMaker
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import Developed, filtered, finish_shot
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.training.kind import SampleMaker
from camkit.models_def.training.recipe import Recipe
from camkit.models_def.training.sample import Sample
from camkit.runtime.bank.baselines import (
    RL_ROUNDS_PER_SNR,
    block_filter,
    richardson_lucy_filter,
)
from camkit.runtime.bank.blocks import Block, BlockFilter, taper_edges, to_otf
from camkit.runtime.bank.cross_channel import (
    CROSS_TV_WEIGHT,
    CROSS_WEIGHT,
    cross_channel_filter,
)
from camkit.runtime.bank.total_variation import TV_WEIGHT, admm_tv_filter

Method = Callable[[Developed, BayerRecipe], Tensor]
"""A developed sample -> (1, 3, S, S), linear."""
Numbers = dict[str, float]
"""Of a method, by name."""
Values = tuple[float, ...]
"""Of numbers, in their order."""
FilterMaker = Callable[[NoiseModel, Numbers], BlockFilter]
TURNS: Final = 8
"""Of `tuned` over all numbers, and steps of one of them in a turn, at most."""
STEP: Final = 2.0
"""Its factor, up or down."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tunable:
    """A method whose numbers may be tuned.

    Attributes:
        make_filter: Gives the restoration of a block, of noise and numbers.
        start: Numbers to begin at.
    """

    make_filter: FilterMaker
    start: Numbers


TUNABLE: Final[dict[str, Tunable]] = {
    "rl": Tunable(
        make_filter=lambda noise, numbers: richardson_lucy_filter(
            noise, rounds_per_snr=numbers["rounds_per_snr"]
        ),
        start={"rounds_per_snr": RL_ROUNDS_PER_SNR},
    ),
    "admm-tv": Tunable(
        make_filter=lambda noise, numbers: admm_tv_filter(noise, weight=numbers["tv_weight"]),
        start={"tv_weight": TV_WEIGHT},
    ),
    "cross-channel": Tunable(
        make_filter=lambda noise, numbers: cross_channel_filter(
            noise, tv_weight=numbers["tv_weight"], cross_weight=numbers["cross_weight"]
        ),
        start={"tv_weight": CROSS_TV_WEIGHT, "cross_weight": CROSS_WEIGHT},
    ),
}


def tuned(start: Numbers, score: Callable[[Numbers], float]) -> list[tuple[Numbers, float]]:
    """Climb: one number after the other goes up or down while the score rises.

    Args:
        start: Numbers to begin at.
        score: Judges numbers; more is better.

    Returns:
        All numbers that were tried, and their scores; the best first, beside which no number alone
        is better a step up or down (or `TURNS` are over).
    """
    scores: dict[Values, float] = {}

    def judged(values: Values) -> float:
        if values not in scores:
            scores[values] = score(dict(zip(start, values, strict=True)))
        return scores[values]

    best, before = tuple(start.values()), None
    judged(best)  # of equals the first is the best
    ways = list(product(range(len(best)), (STEP, 1 / STEP)))
    for _ in range(TURNS):
        if best == before:
            break
        before = best
        for place, step in ways:
            best = _climbed(best, place, step, judged)
    ranked = sorted(scores, key=lambda values: -scores[values])
    return [(dict(zip(start, values, strict=True)), scores[values]) for values in ranked]


def _climbed(values: Values, place: int, step: float, judged: Callable[[Values], float]) -> Values:
    for _ in range(TURNS):
        after = _stepped(values, place, step)
        if judged(after) <= judged(values):
            break
        values = after
    return values


def _stepped(values: Values, place: int, step: float) -> Values:
    # rounded: up and down again is where it was
    changed = float(f"{values[place] * step:.4g}")
    return (*values[:place], changed, *values[place + 1 :])


def by_block(method: str, numbers: Numbers | None = None) -> Method:
    """Return a method of the runtime (see `block_filter`) on a sample as one block.

    Args:
        method: Its name.
        numbers: Of one of `TUNABLE`; None for the runtime's.
    """

    def restore(developed: Developed, recipe: BayerRecipe) -> Tensor:
        given, settings = developed.given, recipe.wiener
        planes, kernels = developed.planes[0].numpy(), given.frozen[0].numpy()
        otf = to_otf(kernels, planes.shape[-1])
        block = Block(
            samples=taper_edges(planes, otf, settings.overlap_px // 4),
            otf=otf,
            unknown=developed.unknown[0].numpy() if bool(developed.unknown.any()) else None,
            height_mm=given.height_mm,
        )
        noise = given.noise.raised(given.noise_rise)
        if numbers is None:
            restored = block_filter(method, settings, noise, kernels.shape[-1])(block)
        else:
            restored = TUNABLE[method].make_filter(noise, numbers)(block)
        return torch.from_numpy(restored)[None]

    return restore


def wiener_alone(developed: Developed, recipe: BayerRecipe) -> Tensor:
    """Return what the bank makes of every colour for itself."""
    return filtered(developed, recipe.with_together(None))


METHODS: Final = ("wiener-alone", *TUNABLE)


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


def with_method(
    name: str, maker: SampleMaker, recipe: Recipe, numbers: Numbers | None = None
) -> SampleMaker:
    """Return a maker of the same samples by a method; exits where the camera has no bank.

    Args:
        name: One of `METHODS`.
        maker: Of the usual samples.
        recipe: Their camera.
        numbers: Of the method; None for the runtime's.
    """
    if not (isinstance(maker, BayerMaker | TileMaker) and isinstance(recipe, BayerRecipe)):
        raise SystemExit(f"{name} is for cameras behind a mosaic; {recipe.name} is none")
    method = by_block(name, numbers) if name in TUNABLE else wiener_alone
    return ClassicalMaker(maker=maker, recipe=recipe, method=method)

"""The thesis's networks as recipes name them, between planes of roots.

roots -- square -- network of the thesis, linear light -- root -- roots
"""

from collections.abc import Callable
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.thesis.chain import ThesisChain
from camkit.models_def.networks.thesis.fusion import FusionConfig, FusionNetwork
from camkit.models_def.networks.thesis.highlight import HighlightConfig, HighlightUnet
from camkit.models_def.networks.thesis.splitting import SplittingConfig, SplittingNetwork

PICTURE: Final = 3


class BetweenRoots(nn.Module):
    """A network of linear pictures as one from planes of roots to planes of roots.

    Pictures lie one after the other in the channels, three each.
    """

    def __init__(self, body: nn.Module) -> None:
        super().__init__()
        self.body = body
        self.stride_px: Any = body.stride_px

    def linear(self, light: Tensor) -> Tensor:
        """Return (b, 3 m, h, w) linear from (b, 3 n, h, w) linear."""
        found = self.body(*torch.split(light, PICTURE, dim=1))
        return torch.cat(found, dim=1) if isinstance(found, tuple) else torch.as_tensor(found)

    def forward(self, roots: Tensor) -> Tensor:
        """Return (b, 3 m, h, w) roots from (b, 3 n, h, w) roots."""
        return to_roots(self.linear(to_light(roots)))


def to_light(roots: Tensor) -> Tensor:
    """Return linear light from its roots."""
    return roots.clamp(min=0).square()


def to_roots(light: Tensor) -> Tensor:
    """Return the roots of linear light; what is negative has 0."""
    return light.clamp(min=0).sqrt()


def _chain(**tables: Any) -> nn.Module:
    configs = {"splitting": SplittingConfig, "highlight": HighlightConfig, "fusion": FusionConfig}
    if unknown := sorted(set(tables) - set(configs)):
        raise TypeError(f"there is no part {unknown[0]!r}")
    return ThesisChain(**{k: configs[k](**_tuples(v)) for k, v in tables.items()})


_BUILDERS: Final[dict[str, Callable[..., nn.Module]]] = {
    "thesis_split": lambda **config: SplittingNetwork(SplittingConfig(**config)),
    "thesis_highlight": lambda **config: HighlightUnet(HighlightConfig(**config)),
    "thesis_fusion": lambda **config: FusionNetwork(FusionConfig(**config)),
    "thesis_chain": _chain,
}

THESIS_NAMES: Final = tuple(_BUILDERS)


def build_thesis_network(name: str, **config: Any) -> BetweenRoots:
    """Build an untrained network, VGG-19 in it with random weights.

    Args:
        name: One of `THESIS_NAMES`.
        config: Fields of its config that differ; of `thesis_chain` a table for each of
            `splitting`, `highlight`, `fusion`.

    Raises:
        ContractError: If a field is unknown or a value is out of range.
    """
    try:
        return BetweenRoots(_BUILDERS[name](**_tuples(config)))
    except TypeError as error:
        raise ContractError(f"network {name} does not take this configuration: {error}") from error


def _tuples(config: dict[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in config.items()}

"""The thesis's networks as recipes name them, between planes of roots.

roots -- square -- network of the thesis, linear light -- root -- roots
"""

from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.models_def.kinds.hdr.thesis.chain import ThesisChain
from camkit.models_def.kinds.hdr.thesis.fusion import FusionConfig, FusionNetwork
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightConfig, HighlightUnet
from camkit.models_def.kinds.hdr.thesis.splitting import SplittingConfig, SplittingNetwork
from camkit.models_def.networks.catalog import Builders, build_one, configured

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
        output = self.body(*torch.split(light, PICTURE, dim=1))
        return torch.cat(output, dim=1) if isinstance(output, tuple) else torch.as_tensor(output)

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


_BUILDERS: Final[Builders] = {
    "thesis_split": configured(SplittingNetwork, SplittingConfig),
    "thesis_highlight": configured(HighlightUnet, HighlightConfig),
    "thesis_fusion": configured(FusionNetwork, FusionConfig),
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
    return BetweenRoots(build_one(_BUILDERS, name, config))


def _tuples(config: dict[str, Any]) -> dict[str, Any]:
    return {k: tuple(v) if isinstance(v, list) else v for k, v in config.items()}

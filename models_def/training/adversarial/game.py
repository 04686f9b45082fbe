"""The rules between a generator and its opponents, and the sum of weighted terms."""

from collections.abc import Callable, Mapping
from typing import Protocol

import torch
from torch import Tensor

Judge = Callable[[Tensor], Tensor]
"""(b, 3, h, w) sRGB pictures in 0..1 -> their scores, (b, 1, m, n) by place."""
Terms = Mapping[str, tuple[float, Tensor]]
"""Name -> weight and value."""


class Game(Protocol):
    """Losses of both players."""

    def lesson(self, judge: Judge, real: Tensor, fake: Tensor, draw: torch.Generator) -> Terms:
        """Return what an opponent minimises.

        Args:
            judge: The opponent.
            real: (b, 3, h, w) true pictures.
            fake: (b, 3, h, w) generated ones, without gradient.
            draw: For what is drawn in a step; on the CPU.
        """
        ...

    def opinion(self, judge: Judge, real: Tensor, fake: Tensor) -> Tensor:
        """Return what the generator minimises by one opponent."""
        ...


def weighted_sum(terms: Terms) -> Tensor:
    """Return the sum of terms by their weights."""
    return torch.stack([weight * value for weight, value in terms.values()]).sum()

"""The best linear filter at one level of light: 7x7 samples to the 16 sub-pixels of a pixel.

What a network must beat, and in the dark what one may as well use.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.bicubic import SCALE

SIDE: Final = 7
RIDGE: Final = 1e-6
"""Share of the mean variance of a sample that is added to every one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearUpscaler:
    """A fitted filter.

    Attributes:
        weights: (16, 1, 7, 7).
        bias: (16,).
    """

    weights: Tensor
    bias: Tensor

    def __call__(self, planes: Tensor) -> Tensor:
        """Return the picture (b, 1, 4 h, 4 w) from planes (b, c, h, w), the first of them light."""
        return functional.pixel_shuffle(
            functional.conv2d(_widened(planes[:, :1]), self.weights, self.bias), SCALE
        )


def fit_linear(pairs: Iterable[tuple[Tensor, Tensor]]) -> LinearUpscaler:
    """Fit the filter of least squares, lightly held to 0.

    Args:
        pairs: Light (1, 1, h, w) and the picture (1, 1, 4 h, 4 w) that it is of.

    Raises:
        ContractError: If there is no pair.
    """
    count = SIDE**2 + 1
    gram = torch.zeros(count, count, dtype=torch.float64)
    cross = torch.zeros(count, SCALE**2, dtype=torch.float64)
    rows = 0
    for light, fine in pairs:
        given = functional.unfold(_widened(light).double(), SIDE)[0].T
        given = torch.cat([given, torch.ones(len(given), 1, dtype=torch.float64)], 1)
        wanted = functional.pixel_unshuffle(fine.double(), SCALE)[0].flatten(1).T
        gram += given.T @ given
        cross += given.T @ wanted
        rows += len(given)
    if rows == 0:
        raise ContractError("a linear filter needs at least one pair to be fitted to")
    held = torch.full((count,), RIDGE * float(gram.diagonal()[:-1].mean()), dtype=torch.float64)
    held[-1] = 0
    found = torch.linalg.solve(gram + held.diag(), cross)
    return LinearUpscaler(
        weights=found[:-1].T.reshape(SCALE**2, 1, SIDE, SIDE).float(), bias=found[-1].float()
    )


def _widened(light: Tensor) -> Tensor:
    return functional.pad(light, (SIDE // 2,) * 4, mode="replicate")

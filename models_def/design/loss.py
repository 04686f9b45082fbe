"""The losses of a joint design.

l1      eq. (6.15): mean |recovered - sharp|
log_mse mean log of the mean square error of a patch: weighs patches as the mean of PSNR does
edof    eq. (6.16): the captures of all depths like that of the reference depth, and each like the
        sharp picture by SSIM; needs no network
"""

from dataclasses import dataclass
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.training.losses import ssim

LossName = Literal["l1", "log_mse", "edof"]
LOSS_NAMES: Final[tuple[LossName, ...]] = get_args(LossName)
_LOG_FLOOR: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignLoss:
    """The loss of a recipe.

    Attributes:
        kind: `l1`: mean absolute error of the recovered picture. `log_mse`: mean logarithm of the
            mean square error of a patch, which weighs patches as the mean PSNR does. `edof`: eq.
            (6.16) of the thesis, of captures, without a network.
        depth_weights: Weight of each depth or configuration (zeta in eq. (6.16)); empty for
            equal ones.
        reference_depth: Index, from 0, of the depth that `edof` compares the others with.
        ssim_weight: Weight of 1 - SSIM in `edof`.
    """

    kind: LossName = "l1"
    depth_weights: tuple[float, ...] = ()
    reference_depth: int = 0
    ssim_weight: float = 3.0

    def __post_init__(self) -> None:
        if self.kind not in LOSS_NAMES:
            raise ContractError(f"a loss is one of {', '.join(LOSS_NAMES)}; got {self.kind!r}")
        if min(self.depth_weights, default=1.0) < 0:
            raise ContractError(f"depth weights must be >= 0; got {self.depth_weights}")

    @property
    def needs_network(self) -> bool:
        """Return whether recovered pictures are judged, not captures."""
        return self.kind != "edof"

    @property
    def is_psnr(self) -> bool:
        """Return whether the mean PSNR of recovered pictures is the aim."""
        return self.needs_network and not self.depth_weights


def design_loss(loss: DesignLoss, pictures: Tensor, sharp: Tensor) -> Tensor:
    """Return the scalar to minimise.

    Args:
        loss: Which.
        pictures: (depth, b, 3, h, w) recovered pictures (captures for `edof`), the same patches
            at every depth.
        sharp: (b, 3, h, w), in the same tone.
    """
    weights = _weights(loss, pictures)
    if loss.kind == "edof":
        reference = pictures[loss.reference_depth]
        differences = (pictures - reference).abs().mean((1, 2, 3, 4))
        unlike = torch.stack([1 - ssim(p, sharp).mean() for p in pictures])
        return (weights * differences).sum() + loss.ssim_weight * unlike.sum()
    gap = pictures - sharp
    if loss.kind == "l1":
        each = gap.abs().mean((1, 2, 3, 4))
    else:
        each = torch.log(gap.square().mean((2, 3, 4)) + _LOG_FLOOR).mean(1)
    return (weights * each).sum() / weights.sum()


def _weights(loss: DesignLoss, pictures: Tensor) -> Tensor:
    if not loss.depth_weights:
        return pictures.new_ones(len(pictures))
    if len(loss.depth_weights) != len(pictures):
        raise ContractError(
            f"{len(pictures)} depths need as many weights; got {len(loss.depth_weights)}"
        )
    return pictures.new_tensor(loss.depth_weights)

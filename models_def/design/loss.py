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
        kind: Which.
        depth_weights: zeta of eq. (6.16), one a depth; for the others the weights of the
            depths' losses; empty for all alike.
        reference_depth: Index of the depth that eq. (6.16) compares with.
        ssim_weight: Of 1 - SSIM in eq. (6.16).
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

"""Losses of restored planes in the square-root domain of the signal, and structural similarity.

The network works on planes whose noise is the same at any ISO; there an error of one unit is
large in a bright ISO 100 patch and small in an ISO 6400 one. Multiplied by
scale * sqrt(shot), the plane becomes sqrt(x + read_variance / shot), about the tone curve of a
display, and an error counts as much as it is seen. Measured: L2 in this domain is 1 dB better on
sRGB values than in the linear domain.

References: Wang, Bovik, Sheikh, Simoncelli 2004 (similarity).
"""

from typing import Final

import torch
from torch import Tensor
from torch.nn.functional import conv2d, max_pool2d

from camkit.errors import ContractError

LOG_FLOOR: Final = 3e-4
RANGE_PX: Final = 5
"""Side of the square whose range an output should keep to."""
_SIGMA_PX: Final = 1.5
_RADIUS_PX: Final = 5
_STABLE: Final = (0.01**2, 0.03**2)


def patch_errors(output: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """Return the mean squared error per patch in the square-root domain.

    Args:
        output: (b, c, h, w) stabilised.
        target: (b, c, h, w) stabilised; negative marks a pixel that is not to be judged.
        weight: (b, c) scale * sqrt(shot) per channel.

    Returns:
        (b,) errors.
    """
    judged, gap = _gap(output, target, weight)
    return gap.square().sum((1, 2, 3)) / judged.sum((1, 2, 3)).clamp(min=1)


def patch_distances(output: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """Return the mean |difference| per patch, (b,), as `patch_errors` has the mean square."""
    judged, gap = _gap(output, target, weight)
    return gap.abs().sum((1, 2, 3)) / judged.sum((1, 2, 3)).clamp(min=1)


def _gap(output: Tensor, target: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Return the judged mask, and the difference in the square-root domain, 0 elsewhere."""
    judged = target >= 0
    return judged, torch.where(judged, output - target, 0.0) * weight[:, :, None, None]


def overshoots(output: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """Return the mean square of what leaves the range of the target around each pixel, per patch.

    A square's range is that of 5x5 pixels of the target. A halo is such an overshoot, a missing
    edge is none: this is no measure of sharpness, and belongs beside `patch_errors`.

    Args:
        output: (b, c, h, w) stabilised.
        target: (b, c, h, w) stabilised; negative marks a pixel that is not to be judged.
        weight: (b, c) scale * sqrt(shot) per channel.

    Returns:
        (b,) in the square-root domain.
    """
    judged = target >= 0
    valid = torch.where(judged, target, -torch.inf)
    most = max_pool2d(valid, RANGE_PX, 1, RANGE_PX // 2)
    negated = torch.where(judged, -target, -torch.inf)
    least = -max_pool2d(negated, RANGE_PX, 1, RANGE_PX // 2)
    excess = torch.relu(output - most) + torch.relu(least - output)
    gap = torch.where(judged, excess, 0.0) * weight[:, :, None, None]
    return gap.square().sum((1, 2, 3)) / judged.sum((1, 2, 3)).clamp(min=1)


def training_loss(loss: str, errors: Tensor) -> Tensor:
    """Return the scalar to minimise from the (b,) errors of the patches, of l1 their distances.

    `log_mse` weighs patches by their relative error, as the mean of PSNR does, down to a floor
    below which a patch counts as good.

    Raises:
        ContractError: If the loss is unknown.
    """
    if loss in {"mse", "l1"}:
        return errors.mean()
    if loss == "log_mse":
        return torch.log(errors + LOG_FLOOR).mean()
    raise ContractError(f"loss must be log_mse, mse or l1; got {loss!r}")


def ssim(one: Tensor, other: Tensor) -> Tensor:
    """Return the mean SSIM (b,) of pictures (b, c, h, w) with values in 0..1, 11 px Gaussian."""
    channels = one.shape[1]
    line = torch.arange(-_RADIUS_PX, _RADIUS_PX + 1, dtype=one.dtype, device=one.device)
    weight = torch.exp(-0.5 * (line / _SIGMA_PX) ** 2)
    weight = (weight / weight.sum()).expand(channels, 1, 1, -1)

    def mean(picture: Tensor) -> Tensor:
        rows = conv2d(picture, weight, groups=channels)
        return conv2d(rows, weight.transpose(-1, -2), groups=channels)

    a, b = mean(one), mean(other)
    spread = mean(one * one) - a * a + mean(other * other) - b * b
    shared = mean(one * other) - a * b
    c1, c2 = _STABLE
    value = (2 * a * b + c1) * (2 * shared + c2) / ((a * a + b * b + c1) * (spread + c2))
    result: Tensor = value.flatten(1).mean(1)
    return result

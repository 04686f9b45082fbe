"""The bound on the light that a network may move, in torch: what training puts behind a network.

Twin of camkit/runtime/network/light.py, held together by tests/parity/test_light_parity.py; the
format is stated in camkit/bundle/light_bound.py.
"""

import torch
from torch import Tensor
from torch.nn import functional

from camkit.bundle.light_bound import (
    BRIGHT_FROM,
    BRIGHT_NOISE,
    CELL_PX,
    CELLS_AVERAGED,
    NEAR_PX,
    NOISE_OF_CELLS,
    SMOOTHING,
    LightBound,
)

_TINY = 1e-6


def keep_share(unknown: Tensor) -> Tensor:
    """Return the share of a network's change that is kept beside clipped samples.

    Args:
        unknown: (b, 1, h, w) bool.

    Returns:
        (b, 1, h, w) float32, 0 beside clipped samples, 1 far from them.
    """
    clipped = unknown.float()
    near = [functional.max_pool2d(clipped, 2 * r + 1, 1, r) for r in NEAR_PX]
    return 1 - torch.stack(near).mean(0)


def bounded(
    output: Tensor,
    front: Tensor,
    keep: Tensor | None,
    bound: LightBound,
    *,
    scale: float,
    bright: Tensor,
) -> Tensor:
    """Return an output with the light taken back that exceeds the bound.

    Args:
        output: (b, c, h, w) of a network, stabilised; h, w multiples of the side of a cell.
        front: (b, c, h, w), the plane that it improves on.
        keep: (b, 1, h, w) of `keep_share`; None for 1 everywhere.
        bound: Of the manifest.
        scale: Divisor of the stabilising transform.
        bright: (b, c) stabilised value of `BRIGHT` in every channel.
    """
    output = functional.relu(output)
    both, more = output + front, output - front
    if keep is not None:
        both = both * keep
    weighted, weight = _smoothed(_means(more * both)), _smoothed(_means(both))
    change = weighted / weight.clamp(min=_TINY)
    excess = change
    if not bound.admits_detail_alone:
        # a design has gradients in the front too; even areas have no contrast, whose root has none
        limit = _limit(_means(front.detach()), bound, scale)
        excess = change - torch.maximum(torch.minimum(change, limit), -limit)
    surplus = functional.interpolate(
        excess, scale_factor=CELL_PX, mode="bilinear", align_corners=False
    )
    restored = output - surplus
    if keep is not None:
        restored = front + keep * (restored - front)
    if not bound.keeps_bright:
        return restored
    white = (front / bright[:, :, None, None]).amin(dim=1, keepdim=True)
    share = ((white - BRIGHT_FROM) / (1 - BRIGHT_FROM)).clamp(0, 1)
    return torch.maximum(restored, share * front - BRIGHT_NOISE * 0.5 / scale)


def _means(planes: Tensor) -> Tensor:
    return functional.avg_pool2d(planes, CELL_PX)


def _smoothed(cells: Tensor) -> Tensor:
    channels = cells.shape[1]
    weights = torch.tensor(SMOOTHING, dtype=cells.dtype, device=cells.device)
    kernel = torch.outer(weights, weights).expand(channels, 1, -1, -1)
    padded = functional.pad(cells, (1, 1, 1, 1), mode="replicate")
    return functional.conv2d(padded, kernel, groups=channels)


def _limit(level: Tensor, bound: LightBound, scale: float) -> Tensor:
    mean = _smoothed(level)
    cell = (0.5 / scale / CELL_PX) ** 2
    variance = (_smoothed(level.square()) - mean.square() - NOISE_OF_CELLS * cell).clamp(min=0)
    light = (bound.light / 2 * mean).square()
    noise = bound.noise**2 * cell / CELLS_AVERAGED
    return (bound.spread**2 * variance + light + noise).sqrt()

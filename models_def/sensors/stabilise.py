"""The noise-stabilising transform in torch: k-sigma, then square root.

Twin of `camkit.runtime.signal.stabilise`; `tests/parity` holds the two together.
"""

import torch
from torch import Tensor

DEFAULT_SCALE = 64.0


def stabilise(
    image: Tensor, shot: Tensor, read_variance: Tensor, *, scale: float = DEFAULT_SCALE
) -> Tensor:
    """Return s = sqrt(max(x / shot + read_variance / shot^2, 0)) / scale.

    The noise of s has the standard deviation 0.5 / scale at any gain.

    Args:
        image: (b, c, h, w), linear, white balanced.
        shot: (b, c) or (c,) variance per unit of signal, > 0.
        read_variance: Same shape, variance at zero signal.
        scale: Divisor behind the square root.

    References: Wang et al. 2020 (k-sigma); Anscombe 1948.
    """
    k, v = _columns(shot), _columns(read_variance)
    return torch.sqrt(torch.clamp(image / k + v / (k * k), min=0)) / scale


def unstabilise(
    stable: Tensor, shot: Tensor, read_variance: Tensor, *, scale: float = DEFAULT_SCALE
) -> Tensor:
    """Undo `stabilise`: x = shot * ((max(s, 0) * scale)^2 - read_variance / shot^2).

    Args:
        stable: (b, c, h, w) of `stabilise`.
        shot: (b, c) or (c,) variance per unit of signal, > 0.
        read_variance: Same shape, variance at zero signal.
        scale: Divisor behind the square root.
    """
    k, v = _columns(shot), _columns(read_variance)
    electrons = torch.square(torch.clamp(stable, min=0) * scale)
    return k * (electrons - v / (k * k))


def _columns(values: Tensor) -> Tensor:
    return values[..., None, None]

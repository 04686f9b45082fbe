"""The noise-stabilising transform before and behind the network: k-sigma, then square root."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import ContractError

DEFAULT_SCALE: Final = 64.0


def stabilise(planes: FloatArray, noise: NoiseModel, *, scale: float = DEFAULT_SCALE) -> FloatArray:
    """Give s = sqrt(max(x / shot + read_variance / shot^2, 0)) / scale.

    The noise of s has the standard deviation 0.5 / scale at any gain.

    Args:
        planes: (3, h, w) float32, linear, white balanced.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.

    Returns:
        (3, h, w) float32 >= 0.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    References: Wang et al. 2020 (k-sigma); Anscombe 1948.
    """
    slope, offset = _line(planes, noise, scale)
    stable = planes * slope
    stable += offset
    np.maximum(stable, 0, out=stable)
    return np.asarray(np.sqrt(stable, out=stable))


def unstabilise(
    stable: FloatArray, noise: NoiseModel, *, scale: float = DEFAULT_SCALE
) -> FloatArray:
    """Undo `stabilise`: x = shot * ((max(s, 0) * scale)^2 - read_variance / shot^2).

    Args:
        stable: (3, h, w) float32 of `stabilise`.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.

    Returns:
        (3, h, w) float32, linear.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    """
    slope, offset = _line(stable, noise, scale)
    planes = np.maximum(stable, 0)
    np.square(planes, out=planes)
    planes -= offset
    planes /= slope
    return planes


def _line(planes: FloatArray, noise: NoiseModel, scale: float) -> tuple[FloatArray, FloatArray]:
    """Give slope and offset, (3, 1, 1) each, of s^2 as a line in x."""
    shot = np.array(noise.shot, dtype=np.float64)[:, None, None]
    read_variance = np.array(noise.read_variance, dtype=np.float64)[:, None, None]
    if planes.ndim != 3 or planes.shape[0] != 3:
        raise ContractError(f"planes must be (3, h, w); got {planes.shape}")
    if (shot <= 0).any() or not (np.isfinite(scale) and scale > 0):
        raise ContractError(
            f"the transform needs shot noise > 0 and a scale > 0; got {noise.shot} and {scale}"
        )
    slope: NDArray[np.float64] = 1 / (shot * scale * scale)
    return slope.astype(np.float32), (slope * read_variance / shot).astype(np.float32)

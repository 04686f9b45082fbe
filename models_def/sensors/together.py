"""The Wiener filter of all colours together, in torch: twin of `camkit.runtime.bank.joint_colours`.

    x_c = a_c l + d_c        l: light that all colours share, of power S; d_c: what c has of its own
    S = scale m^2 (f^2 + f0^2)^(-exponent / 2) k^follow,   power of d_c: own S a_c^2

a_c is the level of a colour over the mean level m of the block, k the measured over the expected
power of the estimate L in the band `BAND`, found with k = 1. With u_c = a_c H_c and

    D_c = (own |u_c|^2 + mistrust V_c a_c^2) S + N_c,   N_c = variance exp(noise_c + 4 rise_c f^2)

the best linear estimate is

    q = sum conj(u_c) Y_c / D_c,   r = sum |u_c|^2 / D_c,   L = S q / (1 + S r)
    X_c = a_c L + own S a_c^2 conj(H_c) (Y_c - u_c L) / D_c

V_c is the variance of the transfer over fabricated copies; frequency 0 stays as it is.
"""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.bundle.stages import Together
from camkit.bundle.stages.together import BAND, BAND_STEP, Spread

CORNER_FREQUENCY = 1 / 512
LEAST_SHARE = 1e-3
LEAST_MEASURED = 1e-6

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """The numbers of `Together` as tensors, so that they can be fitted.

    Attributes:
        noise: (c,).
        noise_rise: (c,).
        scale: Of the prior.
        exponent: Of its fall.
        follow: How it follows what was measured.
        own: Power of what a colour has of its own.
        mistrust: Of the transfer.
    """

    noise: Tensor
    noise_rise: Tensor
    scale: Tensor
    exponent: Tensor
    follow: Tensor
    own: Tensor
    mistrust: Tensor

    @classmethod
    def of(cls, together: Together, like: Tensor) -> "Numbers":
        """Return the numbers of a bundle or recipe."""
        return cls(
            noise=like.new_tensor(together.noise),
            noise_rise=like.new_tensor(together.noise_rise),
            scale=like.new_tensor(together.scale),
            exponent=like.new_tensor(together.exponent),
            follow=like.new_tensor(together.follow),
            own=like.new_tensor(together.own),
            mistrust=like.new_tensor(together.mistrust),
        )


def frequencies_squared(size: tuple[int, int], like: Tensor) -> Tensor:
    """Return f^2 of a half spectrum, (h, w // 2 + 1)."""
    fy = torch.fft.fftfreq(size[0], dtype=torch.float64, device=like.device)[:, None]
    fx = torch.fft.rfftfreq(size[1], dtype=torch.float64, device=like.device)[None, :]
    squared: Tensor = (fy * fy + fx * fx).to(like.dtype)
    return squared


def spread_at(spread: Spread, height_mm: float, f2: Tensor) -> Tensor:
    """Return V of a field height, (c, h, w // 2 + 1); linear between the table's places."""
    table = np.array(spread.variance, dtype=np.float64)
    heights, places = np.array(spread.heights_mm), np.array(spread.frequencies)
    lines = [
        [np.interp(height_mm, heights, table[:, c, k]) for k in range(len(places))]
        for c in range(table.shape[1])
    ]
    at = f2.sqrt().cpu().numpy()
    return torch.from_numpy(np.stack([np.interp(at, places, line) for line in lines])).to(f2)


def line_means(values: Array, frequencies: tuple[float, ...]) -> Array:
    """Return means (..., n) of a half spectrum (..., h, w // 2 + 1) around every frequency.

    Weighted by the hats between neighbours; 0 at frequency 0, where a transfer is 1.
    """
    places = np.hypot(
        np.fft.fftfreq(values.shape[-2])[:, None],
        np.fft.rfftfreq(values.shape[-2])[None],
    )
    hats = np.stack([np.interp(places, frequencies, unit) for unit in np.eye(len(frequencies))])
    hats[0] = 0
    weights = hats / np.maximum(hats.sum((1, 2), keepdims=True), 1e-12)
    means: Array = np.tensordot(values, weights, axes=([-2, -1], [-2, -1]))
    return means


def restore_together(
    planes: Tensor,
    otf: Tensor,
    level: Tensor,
    variance: Tensor,
    height_mm: float,
    together: Together,
    numbers: Numbers | None = None,
) -> Tensor:
    """Deconvolve periodic patches of one field height.

    Args:
        planes: (b, c, h, w).
        otf: (b, c, h, w // 2 + 1).
        level: (b, c) > 0.
        variance: (b, c) of the noise.
        height_mm: Field height of the patches.
        together: The model.
        numbers: Of it, where they are fitted; None for its own.

    Returns:
        (b, c, h, w).
    """
    f2 = frequencies_squared((planes.shape[-2], planes.shape[-1]), planes)
    spread = spread_at(together.spread, height_mm, f2)
    return restore_doubting(
        planes, otf, level, variance, spread, numbers or Numbers.of(together, planes)
    )


def restore_doubting(
    planes: Tensor,
    otf: Tensor,
    level: Tensor,
    variance: Tensor,
    spread: Tensor,
    numbers: Numbers,
) -> Tensor:
    """Deconvolve periodic patches whose variance of the transfer is known.

    Args:
        planes: (b, c, h, w).
        otf: (b, c, h, w // 2 + 1).
        level: (b, c) > 0.
        variance: (b, c) of the noise.
        spread: V, (b, c, h, w // 2 + 1), or (c, h, w // 2 + 1) of all patches.
        numbers: Of the model.

    Returns:
        (b, c, h, w).
    """
    size = (planes.shape[-2], planes.shape[-1])
    f2 = frequencies_squared(size, planes)
    mean = level.mean(dim=1, keepdim=True)
    a = (level / mean).clamp(min=LEAST_SHARE)[..., None, None]
    spectrum = torch.fft.rfft2(planes)
    prior = numbers.scale * mean.square()[..., None, None]
    prior = prior * (f2 + CORNER_FREQUENCY**2) ** (-numbers.exponent / 2)
    prior = prior * size[0] * size[1]
    noise = (numbers.noise[:, None, None] + 4 * numbers.noise_rise[:, None, None] * f2).exp()
    noise = noise * variance[..., None, None] * size[0] * size[1]
    u = a * otf
    power = u.real.square() + u.imag.square()
    doubt = numbers.own * power + numbers.mistrust * a.square() * spread

    def gathered(at: tuple[slice, ...], scene: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        d = doubt[at] * scene + noise[at]
        q = (u[at].conj() * spectrum[at] / d).sum(1, keepdim=True)
        r = (power[at] / d).sum(1, keepdim=True)
        return q, r, d

    coarse = (slice(None), slice(None), slice(None, None, BAND_STEP), slice(None, None, BAND_STEP))
    q, r, _ = gathered(coarse, prior[coarse])
    expected = r + prior[coarse] * r.square()
    inside = (f2[coarse[2:]] >= BAND[0] ** 2) & (f2[coarse[2:]] <= BAND[1] ** 2)
    gain = (prior[coarse] / (1 + prior[coarse] * r)).square()
    power_of_band = (gain * (q.real.square() + q.imag.square()))[..., inside].sum(-1)
    measured = (power_of_band / (gain * expected)[..., inside].sum(-1))[..., None, None]
    scene = prior * measured.clamp(min=LEAST_MEASURED) ** numbers.follow
    q, r, d = gathered((slice(None),) * 4, scene)
    light = scene * q / (1 + scene * r)
    rest = numbers.own * scene * a.square() * otf.conj() * (spectrum - u * light) / d
    sharp_spectrum = a * light + rest
    sharp_spectrum[..., 0, 0] = spectrum[..., 0, 0]
    restored: Tensor = torch.fft.irfft2(sharp_spectrum, s=size)
    return restored

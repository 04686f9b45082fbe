"""The Wiener filter of one block, in torch: patches with one local kernel each, for training.

Twin of the block filter of `camkit.runtime.bank.wiener`; `tests/parity` holds the two together. A
patch is one periodic block: cut about 80 px from each side of the result, as the bank does.
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage
import torch
from torch import Tensor

from camkit.bundle.stages import Wiener
from camkit.models_def.sensors.together import restore_together

# Tuned on development pictures with the PSF of the first camera; export writes them down.
PRIOR_SCALE = 3e-4
PRIOR_EXPONENT = 2.5
CORNER_FREQUENCY = 1 / 512
# Least NSR where the OTF is far from 1: the real lens differs from the frozen PSF.
KERNEL_ERROR = 1e-2
LEAST_POWER = 1e-12
LEAST_SIGNAL = 1e-6
START_SHARE = 0.1
CLIPPED_REACH_PX = 2
TAPER_SHRINK = 4


def to_otf(kernels: Tensor, size: tuple[int, int]) -> Tensor:
    """Transform (b, c, kh, kw) kernels to the OTF of a periodic (h, w) block.

    A kernel that is wider than the block wraps around it, as light in a periodic picture does.

    Returns:
        (b, c, h, w // 2 + 1) complex; the kernel's centre is the origin.
    """
    kh, kw = kernels.shape[-2:]
    h, w = size
    turns = -(-kh // h), -(-kw // w)
    padded = torch.nn.functional.pad(kernels, (0, turns[1] * w - kw, 0, turns[0] * h - kh))
    lead = padded.shape[:-2]
    wrapped = padded.reshape(*lead, turns[0], h, turns[1], w).sum((-4, -2))
    origin_first: Tensor = torch.roll(wrapped, (-(kh // 2), -(kw // 2)), dims=(-2, -1))
    otf: Tensor = torch.fft.rfft2(origin_first)
    return otf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockFacts:
    """The facts of patches that the bank uses.

    Attributes:
        planes: (b, c, h, w), tapered.
        otf: (b, c, h, w // 2 + 1).
        level: (b, c) > 0; a block darker than its read noise is taken to hold that much signal.
        variance: (b, c) of the noise.
    """

    planes: Tensor
    otf: Tensor
    level: Tensor
    variance: Tensor


def block_facts(
    patches: Tensor, kernels: Tensor, shot: Tensor, read_variance: Tensor, settings: Wiener
) -> BlockFacts:
    """Return the facts of patches that the bank uses; arguments as of `wiener_restore`."""
    otf = to_otf(kernels, (patches.shape[-2], patches.shape[-1]))
    planes = taper_edges(patches, otf, settings.overlap_px // 4)
    mean = planes.mean(dim=(-2, -1)).clamp(min=0)
    power = torch.maximum(mean * mean, read_variance).clamp(min=LEAST_POWER)
    return BlockFacts(
        planes=planes, otf=otf, level=power.sqrt(), variance=shot * mean + read_variance
    )


def wiener_restore(
    patches: Tensor,
    kernels: Tensor,
    shot: Tensor,
    read_variance: Tensor,
    settings: Wiener,
    saturated: Tensor | None = None,
    *,
    height_mm: float = 0.0,
) -> Tensor:
    """Deconvolve patches, each a periodic block.

    Each colour with conj(H) / (|H|^2 + NSR), or all with one model (`together`).

    Args:
        patches: (b, c, h, w), linear, white balanced; sides at least those of the kernels.
        kernels: (b, c, kh, kw), odd sides, each sums to 1.
        shot: (b, c) or (c,), noise after white balance.
        read_variance: Same shape as shot.
        settings: Prior, clip iterations, and the overlap, whose outer quarter is tapered.
        saturated: (b, 1 or c, h, w), true where the sensor clipped; those pixels, and the two
            beside them that the demosaic reaches, are at least as bright as they read. Their
            surroundings are explained by Richardson-Lucy first; the rest goes through the filter.
        height_mm: Field height of the patches, for what copies of the lens differ in there.

    Returns:
        (b, c, h, w).

    References: Sun 2021, eq. (2.9); van der Schaaf and van Hateren 1996 (natural-image prior).
    """
    facts = block_facts(patches, kernels, shot, read_variance, settings)
    patches, otf, level, variance = facts.planes, facts.otf, facts.level, facts.variance
    size = (patches.shape[-2], patches.shape[-1])

    def deconvolved(planes: Tensor, noise: Tensor) -> Tensor:
        if settings.together is not None:
            return restore_together(planes, otf, level, noise, height_mm, settings.together)
        ratio = noise / (settings.prior_scale * level.square())
        return _filter(planes, _gain(otf, ratio, settings.prior_exponent, size))

    if saturated is None or settings.clip_iterations == 0 or not bool(saturated.any()):
        return deconvolved(patches, variance)
    side = 2 * CLIPPED_REACH_PX + 1
    unknown = torch.nn.functional.max_pool2d(
        saturated.to(patches.dtype), side, stride=1, padding=CLIPPED_REACH_PX
    ).bool()
    # Patches without a clipped sample are not touched: no lights, everything is residual.
    clipped_patch = unknown.flatten(1).any(dim=1)[:, None, None, None]
    background = (read_variance / shot.clamp(min=1e-12))[..., None, None]
    rounds, power = settings.clip_iterations, settings.clip_power
    lights = richardson_lucy(patches, otf, background, rounds, unknown, power=power)
    near = _nearness(saturated, settings.clip_reach_px, like=patches)
    remainder = (patches - _filter(lights, otf)).masked_fill(unknown, 0)
    unexplained = (remainder.square() * near).mean(dim=(-2, -1)) * clipped_patch[..., 0, 0]
    lights = torch.where(clipped_patch, lights * near, 0)
    residual = (patches - _filter(lights, otf)).masked_fill(unknown, 0)
    variance = torch.maximum(variance, unexplained)
    return lights + deconvolved(residual, variance)


def _nearness(clipped: Tensor, reach_px: int | None, *, like: Tensor) -> Tensor:
    """Return (b, c, h, w): 1 near clipped samples, falling smoothly to 0; 1 without a reach."""
    if reach_px is None:
        return torch.ones((), dtype=like.dtype, device=like.device)
    near = np.zeros(tuple(clipped.shape), dtype=np.float32)
    for index in np.ndindex(near.shape[:2]):
        mask = clipped[index].cpu().numpy()
        if mask.any():
            distance = scipy.ndimage.distance_transform_edt(~mask)
            t = np.clip(2 - distance * (2 / reach_px), 0, 1)
            near[index] = t * t * (3 - 2 * t)
    return torch.from_numpy(near).to(like)


def richardson_lucy(
    patches: Tensor,
    otf: Tensor,
    background: Tensor,
    iterations: int,
    clipped: Tensor,
    *,
    power: float = 1.0,
) -> Tensor:
    """Sharpen by Richardson-Lucy; clipped samples are at least as bright as they read.

    Args:
        patches: (b, c, h, w), periodic.
        otf: (b, c, h, w // 2 + 1).
        background: (b or 1, c, 1, 1), read_variance / shot.
        iterations: Rounds.
        clipped: (b, 1 or c, h, w) bool.
        power: Of every round's correction, 1 <= power < 3; more goes further in a round.

    References: Richardson 1972; Lucy 1974; Snyder et al. 1993 (background); Meinel 1986 (power).
    """
    measured = (patches + background).clamp(min=LEAST_SIGNAL)
    floor = START_SHARE * patches.mean(dim=(-2, -1), keepdim=True)
    sharp = torch.maximum(patches, floor.clamp(min=LEAST_SIGNAL))
    for _ in range(iterations):
        expected = _filter(sharp, otf).clamp(min=0) + background
        ratio = measured / expected.clamp(min=LEAST_SIGNAL)
        ratio = torch.where(clipped, ratio.clamp(min=1), ratio)
        step = _filter(ratio, otf.conj()).clamp(min=0)
        sharp = sharp * (step if power == 1 else step.pow(power))
    return sharp


def taper_edges(patches: Tensor, otf: Tensor, ring_px: int) -> Tensor:
    """Blend the outer ring of patches to their own periodic blur.

    Args:
        patches: (b, c, h, w).
        otf: (b, c, h, w // 2 + 1) of `to_otf`.
        ring_px: Width of the ring; 0 leaves the patches as they are.

    References: Reeves 2005 (edge taper as pre-processing).
    """
    h, w = patches.shape[-2:]
    ring = min(ring_px, h // 4, w // 4)
    if ring == 0:
        return patches
    shrink = TAPER_SHRINK if h % TAPER_SHRINK == 0 and w % TAPER_SHRINK == 0 else 1
    small = torch.nn.functional.avg_pool2d(patches, shrink)
    m, n = h // shrink, w // shrink
    low = torch.cat(
        [otf[..., : m - m // 2, : n // 2 + 1], otf[..., h - m // 2 :, : n // 2 + 1]], dim=-2
    )
    blurred = _filter(small, low)
    blurred = blurred.repeat_interleave(shrink, dim=-2).repeat_interleave(shrink, dim=-1)
    keep = _taper_line(h, ring, patches)[:, None] * _taper_line(w, ring, patches)
    return blurred + keep * (patches - blurred)


def _taper_line(size: int, ring: int, like: Tensor) -> Tensor:
    steps = (torch.arange(ring, dtype=torch.float64, device=like.device) + 0.5) / ring
    rise = torch.sin(torch.pi / 2 * steps).square().to(like.dtype)
    flat = torch.ones(size - 2 * ring, dtype=like.dtype, device=like.device)
    return torch.cat([rise, flat, rise.flip(0)])


def _filter(patches: Tensor, transfer: Tensor) -> Tensor:
    size = (patches.shape[-2], patches.shape[-1])
    filtered: Tensor = torch.fft.irfft2(torch.fft.rfft2(patches) * transfer, s=size)
    return filtered


def _gain(otf: Tensor, ratio: Tensor, exponent: float, size: tuple[int, int]) -> Tensor:
    """Return conj(H) / (|H|^2 + NSR); `ratio` (b, c) is NSR where the rise is one."""
    h, w = size
    fy = torch.fft.fftfreq(h, dtype=torch.float64, device=otf.device)[:, None]
    fx = torch.fft.rfftfreq(w, dtype=torch.float64, device=otf.device)[None, :]
    rise = ((fy * fy + fx * fx + CORNER_FREQUENCY**2) ** (exponent / 2)).to(otf.real.dtype)
    power = otf.real.square() + otf.imag.square()
    nsr = torch.maximum(ratio[..., None, None].to(rise.dtype) * rise, KERNEL_ERROR * (1 - power))
    nsr[..., 0, 0] = 0
    gain: Tensor = otf.conj() / (power + nsr)
    return gain

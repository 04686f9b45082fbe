"""Classical restoration on the blocks and PSFs of the bank: Richardson-Lucy and ADMM with TV.

They exist to be compared with. Neither clips a highlight; both treat clipped samples as "at least
this bright", and both follow the noise.
"""

from typing import Final, Literal

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from camkit.bundle.stages import Wiener
from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import UnsupportedError
from camkit.runtime.blocks import Block, BlockBank, BlockFilter, ComplexArray, LocalPsf
from camkit.runtime.wiener import apply_transfer, spread_clipped, wiener_filter

Method = Literal["wiener", "rl", "admm-tv"]

# Tuned on development pictures behind the first camera, never on test pictures.
RL_ITERATIONS: Final = 20
TV_WEIGHT: Final = 0.3
TV_STEP: Final = 0.05
ADMM_ITERATIONS: Final = 40


def restoration_bank(
    psf: LocalPsf,
    settings: Wiener,
    noise: NoiseModel,
    *,
    method: str = "wiener",
    threads: int = 1,
) -> BlockBank:
    """Make the bank of a method.

    Args:
        psf: Kernels and place of the capture.
        settings: The manifest's Wiener stage; all methods share its grid.
        noise: Noise of the capture after white balance.
        method: wiener, rl (Richardson-Lucy) or admm-tv.
        threads: Blocks restored at a time; no influence on the bits.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    return BlockBank(
        psf,
        block_filter(method, settings, noise),
        block_px=settings.block_px,
        overlap_px=settings.overlap_px,
        threads=threads,
    )


def block_filter(method: str, settings: Wiener, noise: NoiseModel) -> BlockFilter:
    """Give the block filter of a method.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    if method == "wiener":
        return wiener_filter(settings, noise)
    if method == "rl":
        return richardson_lucy_filter(noise)
    if method == "admm-tv":
        return admm_tv_filter(noise)
    raise UnsupportedError(f"method must be wiener, rl or admm-tv; got {method!r}")


def richardson_lucy_filter(noise: NoiseModel, *, iterations: int = RL_ITERATIONS) -> BlockFilter:
    """Give Richardson-Lucy for Poisson noise with read noise as a known background.

    Args:
        noise: Noise after white balance.
        iterations: Rounds; each sharpens and raises noise.

    References: Richardson 1972; Lucy 1974; Snyder et al. 1993 (background).
    """
    shot = np.maximum(np.array(noise.shot), 1e-12)
    background = (np.array(noise.read_variance) / shot).astype(np.float32)[:, None, None]

    def restore(block: Block) -> FloatArray:
        measured = np.maximum(block.samples + background, np.float32(1e-9))
        clipped = None if block.unknown is None else spread_clipped(block.unknown)
        back = np.conj(block.otf)
        sharp = np.maximum(block.samples, 0.1 * block.samples.mean(axis=(-2, -1), keepdims=True))
        np.maximum(sharp, np.float32(1e-6), out=sharp)
        for _ in range(iterations):
            expected = np.maximum(apply_transfer(sharp, block.otf), 0) + background
            ratio = measured / np.maximum(expected, np.float32(1e-9))
            if clipped is not None:
                ratio = np.where(clipped, np.maximum(ratio, 1), ratio)
            sharp *= np.maximum(apply_transfer(ratio, back), 0)
        return np.asarray(sharp)

    return restore


def admm_tv_filter(
    noise: NoiseModel, *, weight: float = TV_WEIGHT, iterations: int = ADMM_ITERATIONS
) -> BlockFilter:
    """Give least squares with isotropic total variation, solved by ADMM.

    min over x of 1/2 |h * x - y|^2 + beta |grad x|_1, beta = weight * variance / level.

    Args:
        noise: Noise after white balance.
        weight: Strength of the total variation.
        iterations: Rounds of ADMM.

    References: Sun 2021, eq. (2.11); Wang et al. 2008 (the splitting).
    """
    shot, read_variance = np.array(noise.shot), np.array(noise.read_variance)

    def restore(block: Block) -> FloatArray:
        level = np.maximum(block.samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        level = np.maximum(level, np.sqrt(read_variance) + 1e-6)
        beta = weight * (shot * level + read_variance) / level
        # Gradients below this share of the level are taken for noise in the first round.
        threshold = (TV_STEP * level).astype(np.float32)[:, None, None]
        rho = (beta / (TV_STEP * level)).astype(np.float32)[:, None, None]
        return _admm_tv(block, threshold, np.maximum(rho, np.float32(1e-7)), iterations)

    return restore


def _admm_tv(block: Block, threshold: FloatArray, rho: FloatArray, iterations: int) -> FloatArray:
    size = block.samples.shape[-1]
    clipped = None if block.unknown is None else spread_clipped(block.unknown)
    back = np.conj(block.otf)
    inverse = 1 / (np.square(np.abs(block.otf)) + rho * _gradient_power(size))
    data: ComplexArray = back * scipy.fft.rfft2(block.samples)
    sharp = block.samples
    down, across = np.zeros_like(sharp), np.zeros_like(sharp)
    dual_down, dual_across = np.zeros_like(sharp), np.zeros_like(sharp)
    for _ in range(iterations):
        pull = _divergence(down - dual_down, across - dual_across)
        spectrum = (data + rho * scipy.fft.rfft2(pull)) * inverse
        sharp = np.asarray(scipy.fft.irfft2(spectrum, s=(size, size)))
        dual_down += np.roll(sharp, -1, axis=-2) - sharp
        dual_across += np.roll(sharp, -1, axis=-1) - sharp
        keep = _shrinkage(dual_down, dual_across, threshold)
        down, across = keep * dual_down, keep * dual_across
        dual_down -= down
        dual_across -= across
        if clipped is not None:
            expected = np.maximum(apply_transfer(sharp, block.otf), block.samples)
            data = back * scipy.fft.rfft2(np.where(clipped, expected, block.samples))
    return sharp


def _shrinkage(down: FloatArray, across: FloatArray, threshold: FloatArray) -> FloatArray:
    """Give the factor that shortens every gradient by the threshold."""
    length = np.sqrt(np.square(down) + np.square(across))
    return np.asarray(np.maximum(1 - threshold / np.maximum(length, np.float32(1e-20)), 0))


def _divergence(down: FloatArray, across: FloatArray) -> FloatArray:
    """Give the adjoint of the periodic forward differences."""
    return np.asarray(np.roll(down, 1, axis=-2) - down + np.roll(across, 1, axis=-1) - across)


def _gradient_power(size: int) -> NDArray[np.float32]:
    """Give |D|^2 of the periodic forward differences, (b, b // 2 + 1)."""
    fy, fx = scipy.fft.fftfreq(size)[:, None], scipy.fft.rfftfreq(size)[None, :]
    power = 4 * (np.sin(np.pi * fy) ** 2 + np.sin(np.pi * fx) ** 2)
    return np.asarray(power, dtype=np.float32)

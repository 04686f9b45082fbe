"""Classical restoration on the blocks and PSFs of the bank: Richardson-Lucy and ADMM with TV.

They exist to be compared with. Neither clips a highlight; both treat clipped samples as "at least
this bright", and both follow the noise.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages import Wiener
from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import UnsupportedError
from camkit.runtime.bank.blocks import Block, BlockBank, BlockFilter, LocalPsf
from camkit.runtime.bank.richardson_lucy import background_of, richardson_lucy, spread_clipped
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer, inverse, transform
from camkit.runtime.bank.wiener import place_knowledge, wiener_filter

TUNED_ON: Final = "development pictures behind the first camera, never test pictures"
"""What the next six numbers were tuned on."""
RL_ROUNDS_PER_SNR: Final = 0.7
RL_LEAST_ROUNDS: Final = 10
RL_MOST_ROUNDS: Final = 80
TV_WEIGHT: Final = 5.0
TV_STEP: Final = 0.05
ADMM_ITERATIONS: Final = 30
FILL_ITERATIONS: Final = 6
LEAST_RHO: Final = np.float32(1e-7)


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
        block_filter(method, settings, noise, max(psf.kernels.kernels.shape[-2:])),
        block_px=settings.block_px,
        overlap_px=settings.overlap_px,
        threads=threads,
        knowledge=place_knowledge(settings) if method == "wiener" else None,
    )


def block_filter(
    method: str, settings: Wiener, noise: NoiseModel, kernel_px: int | None = None
) -> BlockFilter:
    """Give the block filter of a method; see `wiener_filter`.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    if method == "wiener":
        return wiener_filter(settings, noise, kernel_px)
    if method == "rl":
        return richardson_lucy_filter(noise)
    if method == "admm-tv":
        return admm_tv_filter(noise)
    raise UnsupportedError(f"method must be wiener, rl or admm-tv; got {method!r}")


def method_numbers(method: str) -> Mapping[str, float]:
    """Give the numbers by which a method other than the filter works, by name.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    if method == "rl":
        return {
            "rounds_per_snr": RL_ROUNDS_PER_SNR,
            "least_rounds": RL_LEAST_ROUNDS,
            "most_rounds": RL_MOST_ROUNDS,
        }
    if method == "admm-tv":
        return {"tv_weight": TV_WEIGHT, "tv_step": TV_STEP, "iterations": ADMM_ITERATIONS}
    raise UnsupportedError(f"method must be rl or admm-tv; got {method!r}")


def richardson_lucy_filter(noise: NoiseModel, *, rounds: int | None = None) -> BlockFilter:
    """Give Richardson-Lucy as a block filter.

    Args:
        noise: Noise after white balance.
        rounds: Each sharpens and raises noise; None lets the signal-to-noise ratio of the block
            decide.
    """
    background = background_of(noise)
    shot, read_variance = np.array(noise.shot), np.array(noise.read_variance)

    def restore(block: Block) -> FloatArray:
        level = np.maximum(block.samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        deviation = np.sqrt(np.maximum(shot * level + read_variance, 1e-20))
        wanted = RL_ROUNDS_PER_SNR * float((level / deviation).mean())
        count = int(np.clip(wanted, RL_LEAST_ROUNDS, RL_MOST_ROUNDS)) if rounds is None else rounds
        clipped = None if block.unknown is None else spread_clipped(block.unknown)
        return richardson_lucy(block.samples, block.otf, background, count, clipped)

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
    background = background_of(noise)

    def restore(block: Block) -> FloatArray:
        samples = block.samples
        level = np.maximum(samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        level = np.maximum(level, np.sqrt(read_variance) + 1e-6)
        variance = shot * level + read_variance
        if block.unknown is not None:
            samples, unexplained = _fill_clipped(block, background)
            variance = np.maximum(variance, unexplained)
        # Gradients below this share of the level are taken for noise in the first round.
        threshold = (TV_STEP * level).astype(np.float32)[:, None, None]
        rho = (weight * variance / (TV_STEP * level * level)).astype(np.float32)[:, None, None]
        return _admm_tv(samples, block.otf, threshold, np.maximum(rho, LEAST_RHO), iterations)

    return restore


def _fill_clipped(block: Block, background: FloatArray) -> tuple[FloatArray, NDArray[np.float64]]:
    """Fill clipped samples with what Richardson-Lucy predicts, and give what it cannot explain."""
    assert block.unknown is not None
    clipped = spread_clipped(block.unknown)
    lights = richardson_lucy(block.samples, block.otf, background, FILL_ITERATIONS, clipped)
    expected = apply_transfer(lights, block.otf)
    residual = np.where(clipped, 0, block.samples - expected)
    filled = np.where(clipped, np.maximum(expected, block.samples), block.samples)
    return filled, np.square(residual).mean(axis=(-2, -1), dtype=np.float64)


def _admm_tv(
    samples: FloatArray,
    otf: ComplexArray,
    threshold: FloatArray,
    rho: FloatArray,
    iterations: int,
) -> FloatArray:
    size = samples.shape[-1]
    damping = 1 / (np.square(np.abs(otf)) + rho * _gradient_power(size))
    data = np.conj(otf) * transform(samples)
    sharp = samples
    down, across = np.zeros_like(sharp), np.zeros_like(sharp)
    dual_down, dual_across = np.zeros_like(sharp), np.zeros_like(sharp)
    for _ in range(iterations):
        pull = _divergence(down - dual_down, across - dual_across)
        spectrum = (data + rho * transform(pull)) * damping
        sharp = inverse(spectrum, size)
        dual_down += np.roll(sharp, -1, axis=-2) - sharp
        dual_across += np.roll(sharp, -1, axis=-1) - sharp
        keep = _shrinkage(dual_down, dual_across, threshold)
        down, across = keep * dual_down, keep * dual_across
        dual_down -= down
        dual_across -= across
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
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    power = 4 * (np.sin(np.pi * fy) ** 2 + np.sin(np.pi * fx) ** 2)
    return np.asarray(power, dtype=np.float32)

"""Least squares with total variation on one periodic block, solved by ADMM."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, BlockFilter
from camkit.runtime.bank.richardson_lucy import background_of, richardson_lucy, spread_clipped
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer, inverse, transform

TV_WEIGHT: Final = 5.0
TV_STEP: Final = 0.05
ADMM_ITERATIONS: Final = 30
FILL_ITERATIONS: Final = 6
LEAST_RHO: Final = np.float32(1e-7)


def admm_tv_filter(
    noise: NoiseModel, *, weight: float = TV_WEIGHT, iterations: int = ADMM_ITERATIONS
) -> BlockFilter:
    """Return least squares with isotropic total variation, solved by ADMM.

    min over x of 1/2 |h * x - y|^2 + beta |grad x|_1, beta = weight * variance / level.

    Args:
        noise: Noise after white balance.
        weight: Strength of the total variation.
        iterations: Rounds of ADMM.

    References: Sun 2021, eq. (2.11); Wang et al. 2008 (the splitting).
    """
    light = light_of_block(noise)

    def restore(block: Block) -> FloatArray:
        block_light = light(block)
        threshold, rho = block_light.splitting(weight)
        return _admm_tv(block_light.samples, block.otf, threshold, rho, iterations)

    return restore


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockLight:
    """The terms of least squares for a block; clipped samples are filled.

    Attributes:
        samples: (c, b, b) float32.
        level: (c,) > 0, mean light.
        variance: (c,) of the noise at that level, and of what clipped samples leave unexplained.
    """

    samples: FloatArray
    level: NDArray[np.float64]
    variance: NDArray[np.float64]

    def splitting(self, weight: float) -> tuple[FloatArray, FloatArray]:
        """Return threshold and rho of a total variation, (c, 1, 1); their product is beta.

        Gradients below the threshold, a share of the level, are taken for noise in the first round.
        """
        threshold = (TV_STEP * self.level).astype(np.float32)[:, None, None]
        rho = weight * self.variance / (TV_STEP * self.level * self.level)
        return threshold, np.maximum(rho.astype(np.float32)[:, None, None], LEAST_RHO)


def light_of_block(noise: NoiseModel) -> Callable[[Block], BlockLight]:
    """Return the function that computes the light of blocks in a noise."""
    shot, read_variance = np.array(noise.shot), np.array(noise.read_variance)
    background = background_of(noise)

    def light(block: Block) -> BlockLight:
        samples = block.samples
        level = np.maximum(samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        level = np.maximum(level, np.sqrt(read_variance) + 1e-6)
        variance = shot * level + read_variance
        if block.unknown is not None:
            samples, unexplained = _fill_clipped(block, background)
            variance = np.maximum(variance, unexplained)
        return BlockLight(samples=samples, level=level, variance=variance)

    return light


def _fill_clipped(block: Block, background: FloatArray) -> tuple[FloatArray, NDArray[np.float64]]:
    """Fill clipped samples with what Richardson-Lucy predicts, and return the rest."""
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
    damping = 1 / (np.square(np.abs(otf)) + rho * gradient_power(size))
    data = np.conj(otf) * transform(samples)
    sharp = samples
    down, across = np.zeros_like(sharp), np.zeros_like(sharp)
    dual_down, dual_across = np.zeros_like(sharp), np.zeros_like(sharp)
    for _ in range(iterations):
        pull = backward(down - dual_down, across - dual_across)
        spectrum = (data + rho * transform(pull)) * damping
        sharp = inverse(spectrum, size)
        step_down, step_across = differences(sharp)
        dual_down += step_down
        dual_across += step_across
        keep = _shrinkage(dual_down, dual_across, threshold)
        down, across = keep * dual_down, keep * dual_across
        dual_down -= down
        dual_across -= across
    return sharp


def _shrinkage(down: FloatArray, across: FloatArray, threshold: FloatArray) -> FloatArray:
    """Return the factor that shortens every gradient by the threshold."""
    length = np.sqrt(np.square(down) + np.square(across))
    return np.asarray(np.maximum(1 - threshold / np.maximum(length, np.float32(1e-20)), 0))


def differences(planes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the periodic forward differences (down, across) of (..., b, b) planes."""
    return np.roll(planes, -1, axis=-2) - planes, np.roll(planes, -1, axis=-1) - planes


def backward(down: FloatArray, across: FloatArray) -> FloatArray:
    """Return the adjoint of `differences`."""
    return np.asarray(np.roll(down, 1, axis=-2) - down + np.roll(across, 1, axis=-1) - across)


def gradient_power(size: int) -> NDArray[np.float32]:
    """Return |D|^2 of the periodic forward differences, (b, b // 2 + 1)."""
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    power = 4 * (np.sin(np.pi * fy) ** 2 + np.sin(np.pi * fx) ** 2)
    return np.asarray(power, dtype=np.float32)

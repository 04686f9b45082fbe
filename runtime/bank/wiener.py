"""The Wiener bank: every block deconvolved with its own PSF, regularised by the noise.

    X = Y conj(H) / (|H|^2 + N / S),  S(f) = prior_scale * level^2 * (f^2 + f0^2)^(-exponent / 2)

or, where the bundle says so, all colours of a block with one model (`together`), near the axis from
the samples of the mosaic (`mosaic`).

Where the sensor clipped, a linear filter would turn the missing light into rings over the whole
block. There a few rounds of Richardson-Lucy, which take clipped samples as "at least this bright",
explain the lights first (`lights`); the Wiener filter gets what they leave, and what they leave
unexplained near the lights counts as noise.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Mosaic, Wiener
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, BlockFilter, PlaceKnowledge
from camkit.runtime.bank.joint_colours import Transfer, restore_together, transfer_of
from camkit.runtime.bank.lights import explain_lights
from camkit.runtime.bank.mosaic import MosaicTransfer, mosaic_transfer, restore_mosaic
from camkit.runtime.bank.richardson_lucy import background_of, spread_clipped
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer

CORNER_FREQUENCY: Final = 1 / 512
"""f0 in cycles/pixel: below it the prior no longer rises."""

LEAST_POWER: Final = 1e-12

KERNEL_ERROR: Final = 1e-2
"""Least NSR where the OTF is far from 1: the real lens differs from the frozen PSF, and what the
frozen OTF calls almost nothing must not be raised without end."""


def wiener_filter(settings: Wiener, noise: NoiseModel, kernel_px: int | None = None) -> BlockFilter:
    """Return the Wiener filter of one block as a block filter.

    Args:
        settings: Prior, and rounds of Richardson-Lucy for clipped blocks.
        noise: Noise after white balance.
        kernel_px: Side of the kernels; None explains lights in whole blocks only.

    References: Sun 2021, eq. (2.9); van der Schaaf and van Hateren 1996 (natural-image prior).
    """
    shot, read_variance = np.array(noise.shot), np.array(noise.read_variance)
    background = background_of(noise)

    def restore(block: Block) -> FloatArray:
        level = np.maximum(block.samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        variance = shot * level + read_variance
        # A block darker than its read noise is taken to hold that much signal.
        power = np.maximum(np.maximum(level * level, read_variance), LEAST_POWER)

        def deconvolved(samples: FloatArray, variance: NDArray[np.float64]) -> FloatArray:
            if settings.together is not None:
                facts = {"level": np.sqrt(power), "variance": variance}
                return _restored(block, samples, settings, facts)
            rise = _prior_rise(samples.shape[-1], settings.prior_exponent)
            gain = _gain(block.otf, rise, variance / (settings.prior_scale * power))
            return apply_transfer(samples, gain)

        if block.unknown is None or settings.clip_iterations == 0:
            return deconvolved(block.samples, variance)
        unknown = spread_clipped(block.unknown)
        lights, unexplained = explain_lights(block, unknown, background, settings, kernel_px)
        residual = block.samples - apply_transfer(lights, block.otf)
        # samples beside clipped ones were measured: it is their demosaicked planes that suffer
        by_samples = _mosaic_at(settings, block.height_mm, block.red, block.otf) is not None
        np.copyto(residual, 0, where=block.unknown if by_samples else unknown)
        variance = np.maximum(variance, unexplained)
        return lights + deconvolved(residual, variance)

    return restore


def place_knowledge(settings: Wiener, red: tuple[int, int] | None = None) -> PlaceKnowledge | None:
    """Return the terms of the filter for all blocks of a place; None if there are none.

    Args:
        settings: Of the bank.
        red: Place of red in the capture's mosaic; None for none.
    """
    if (model := settings.together) is None:
        return None

    def know(otf: ComplexArray, height_mm: float) -> Transfer | MosaicTransfer:
        if _mosaic_at(settings, height_mm, red, otf) is not None:
            return mosaic_transfer(otf, height_mm, model)
        return transfer_of(otf, height_mm, model)

    return know


def _mosaic_at(
    settings: Wiener, height_mm: float, red: tuple[int, int] | None, otf: ComplexArray
) -> Mosaic | None:
    """Return how a block is restored from the samples of its mosaic; None where it is not."""
    mosaic = settings.mosaic
    if mosaic is None or red is None or height_mm > mosaic.within_mm or otf.shape[1] % 2:
        return None
    return mosaic


def _restored(
    block: Block,
    samples: FloatArray,
    settings: Wiener,
    facts: dict[str, NDArray[np.float64]],
) -> FloatArray:
    """Return samples of a block, or what its lights leave of them, with all colours together."""
    model, knowledge = settings.together, block.knowledge
    assert model is not None
    mosaic = _mosaic_at(settings, block.height_mm, block.red, block.otf)
    if mosaic is not None and block.red is not None:
        if not isinstance(knowledge, MosaicTransfer):
            knowledge = mosaic_transfer(block.otf, block.height_mm, model)
        return restore_mosaic(
            samples, knowledge, red=block.red, model=model, mosaic=mosaic, **facts
        )
    if not isinstance(knowledge, Transfer):
        knowledge = transfer_of(block.otf, block.height_mm, model)
    return restore_together(samples, knowledge, model=model, **facts)


@lru_cache(maxsize=4)
def _prior_rise(block_px: int, exponent: float) -> FloatArray:
    """Return 1 / S(f) for a prior scale and level of one, (b, b // 2 + 1)."""
    fy, fx = np.fft.fftfreq(block_px)[:, None], np.fft.rfftfreq(block_px)[None, :]
    rise = ((fy * fy + fx * fx + CORNER_FREQUENCY**2) ** (exponent / 2)).astype(np.float32)
    rise.flags.writeable = False
    return np.asarray(rise)


def _gain(otf: ComplexArray, rise: FloatArray, ratio: NDArray[np.float64]) -> ComplexArray:
    """Return conj(H) / (|H|^2 + NSR); `ratio` is NSR per colour where the rise is one."""
    power = np.square(otf.real)
    power += np.square(otf.imag)
    nsr = ratio.astype(np.float32)[:, None, None] * rise
    np.maximum(nsr, np.float32(KERNEL_ERROR) * (1 - power), out=nsr)
    nsr[:, 0, 0] = 0
    power += nsr
    gain = np.conj(otf)
    # Multiplied, since numpy divides complex by real as complex by complex: twice the time.
    np.reciprocal(power, out=power)
    gain *= power
    return gain

"""The Wiener bank: every block deconvolved with its own PSF, regularised by the noise.

    X = Y conj(H) / (|H|^2 + N / S),  S(f) = prior_scale * level^2 * (f^2 + f0^2)^(-exponent / 2)

Clipped pixels are unknown: they are filled with what the restored block predicts for them.
"""

from typing import Final

import numpy as np
import scipy.fft
import scipy.ndimage
from numpy.typing import NDArray

from camkit.bundle.stages import Wiener
from camkit.contracts import FloatArray, NoiseModel
from camkit.runtime.blocks import Block, BlockBank, BlockFilter, ComplexArray, LocalPsf

CORNER_FREQUENCY: Final = 1 / 512
"""f0 in cycles/pixel: below it the prior no longer rises."""

LEAST_NSR: Final = 1e-6
"""Keeps float32 rounding from being raised where the OTF vanishes."""

CLIPPED_REACH_PX: Final = 2
"""How far the demosaic spreads a clipped sample."""


def wiener_bank(
    psf: LocalPsf, settings: Wiener, noise: NoiseModel, *, threads: int = 1
) -> BlockBank:
    """Make the front end of a capture.

    Args:
        psf: Kernels and place of the capture.
        settings: The manifest's Wiener stage.
        noise: Noise of the capture after white balance.
        threads: Blocks restored at a time; no influence on the bits.
    """
    return BlockBank(
        psf,
        wiener_filter(settings, noise),
        block_px=settings.block_px,
        overlap_px=settings.overlap_px,
        threads=threads,
    )


def wiener_filter(settings: Wiener, noise: NoiseModel) -> BlockFilter:
    """Give the Wiener filter of one block as a block filter.

    Args:
        settings: Prior and clip iterations.
        noise: Noise after white balance.

    References: Sun 2021, eq. (2.9); van der Schaaf and van Hateren 1996 (natural-image prior).
    """
    rise = _prior_rise(settings.block_px, settings.prior_exponent)

    def restore(block: Block) -> FloatArray:
        size_px = block.samples.shape[-1]
        known = (
            rise if size_px == settings.block_px else _prior_rise(size_px, settings.prior_exponent)
        )
        gain = _gain(block, known, noise_to_signal(block.samples, noise, settings.prior_scale))
        if block.unknown is None or settings.clip_iterations == 0:
            return apply_transfer(block.samples, gain)
        return _restore_clipped(
            block, spread_clipped(block.unknown), gain, settings.clip_iterations
        )

    return restore


def noise_to_signal(samples: FloatArray, noise: NoiseModel, prior_scale: float) -> FloatArray:
    """Give noise variance / (prior_scale * level^2) per colour at the block's mean level.

    Args:
        samples: (3, h, w).
        noise: Noise after white balance.
        prior_scale: Scale of the prior.

    Returns:
        (3,) float32.
    """
    level = np.maximum(samples.mean(axis=(-2, -1), dtype=np.float64), 0)
    read_variance = np.array(noise.read_variance)
    variance = np.array(noise.shot) * level + read_variance
    # A block darker than its read noise is taken to hold that much signal.
    power = np.maximum(np.maximum(level * level, read_variance), 1e-12)
    return np.asarray(variance / (prior_scale * power), dtype=np.float32)


def apply_transfer(samples: FloatArray, transfer: ComplexArray) -> FloatArray:
    """Multiply the spectrum of a periodic (3, h, w) block by a transfer function."""
    spectrum = scipy.fft.rfft2(samples)
    spectrum *= transfer
    return np.asarray(scipy.fft.irfft2(spectrum, s=samples.shape[-2:], overwrite_x=True))


def _prior_rise(block_px: int, exponent: float) -> FloatArray:
    """Give 1 / S(f) for a prior scale and level of one, (b, b // 2 + 1)."""
    fy, fx = scipy.fft.fftfreq(block_px)[:, None], scipy.fft.rfftfreq(block_px)[None, :]
    rise = (fy * fy + fx * fx + CORNER_FREQUENCY**2) ** (exponent / 2)
    return np.asarray(rise, dtype=np.float32)


def _gain(block: Block, rise: FloatArray, ratio: FloatArray) -> ComplexArray:
    power = np.square(block.otf.real)
    power += np.square(block.otf.imag)
    nsr = ratio[:, None, None] * rise
    np.maximum(nsr, np.float32(LEAST_NSR), out=nsr)
    nsr[:, 0, 0] = 0
    power += nsr
    gain = np.conj(block.otf)
    gain /= power
    return gain


def spread_clipped(saturated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Widen a (c, h, w) mask of clipped samples to all that the demosaic made of them."""
    side = 2 * CLIPPED_REACH_PX + 1
    wide = scipy.ndimage.maximum_filter(
        saturated.astype(np.uint8), size=(1, side, side), mode="constant"
    )
    return np.asarray(wide, dtype=np.bool_)


def _restore_clipped(
    block: Block, unknown: NDArray[np.bool_], gain: ComplexArray, iterations: int
) -> FloatArray:
    """Deconvolve and fill the clipped samples in turn; a fill never falls below the sample."""
    restored = apply_transfer(block.samples, gain)
    for _ in range(iterations):
        expected = apply_transfer(np.maximum(restored, 0), block.otf)
        np.maximum(expected, block.samples, out=expected)
        restored = apply_transfer(np.where(unknown, expected, block.samples), gain)
    return restored

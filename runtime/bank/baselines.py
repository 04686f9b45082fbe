"""Classical restoration on the blocks and PSFs of the bank.

Richardson-Lucy, ADMM with total variation, and the cross-channel prior exist to be compared with.
None clips a highlight; all treat clipped samples as "at least this bright", and all follow the
noise.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.stages import Wiener
from camkit.errors import UnsupportedError
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, BlockBank, BlockFilter, LocalPsf
from camkit.runtime.bank.cross_channel import (
    CROSS_ROUNDS,
    CROSS_TV_WEIGHT,
    CROSS_WEIGHT,
    cross_channel_filter,
)
from camkit.runtime.bank.richardson_lucy import background_of, richardson_lucy, spread_clipped
from camkit.runtime.bank.total_variation import (
    ADMM_ITERATIONS,
    TV_STEP,
    TV_WEIGHT,
    admm_tv_filter,
)
from camkit.runtime.bank.wiener import place_knowledge, wiener_filter

TUNED_ON: Final = "development pictures behind the first camera, never test pictures"
"""What the numbers of rl and admm-tv were tuned on."""
RL_ROUNDS_PER_SNR: Final = 0.7
RL_LEAST_ROUNDS: Final = 10
RL_MOST_ROUNDS: Final = 80


def restoration_bank(
    psf: LocalPsf,
    settings: Wiener,
    noise: NoiseModel,
    *,
    method: str = "wiener",
    threads: int = 1,
    red: tuple[int, int] | None = None,
) -> BlockBank:
    """Make the bank of a method.

    Args:
        psf: Kernels and place of the capture.
        settings: The manifest's Wiener stage; all methods share its grid.
        noise: Noise of the capture after white balance.
        method: wiener, rl (Richardson-Lucy), admm-tv or cross-channel.
        threads: Blocks restored at a time; no influence on the bits.
        red: (row, column) of red in the first cell of the capture's mosaic; None for none.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    return BlockBank(
        psf,
        block_filter(method, settings, noise, max(psf.kernels.kernels.shape[-2:])),
        block_px=settings.block_px,
        overlap_px=settings.overlap_px,
        threads=threads,
        knowledge=place_knowledge(settings, red) if method == "wiener" else None,
        red=red,
    )


def block_filter(
    method: str, settings: Wiener, noise: NoiseModel, kernel_px: int | None = None
) -> BlockFilter:
    """Return the block filter of a method; see `wiener_filter`.

    Raises:
        UnsupportedError: If the method is unknown.
    """
    if method == "wiener":
        return wiener_filter(settings, noise, kernel_px)
    if method == "rl":
        return richardson_lucy_filter(noise)
    if method == "admm-tv":
        return admm_tv_filter(noise)
    if method == "cross-channel":
        return cross_channel_filter(noise)
    raise UnsupportedError(f"method must be wiener, rl, admm-tv or cross-channel; got {method!r}")


def method_numbers(method: str) -> Mapping[str, float]:
    """Return the numbers by which a method other than the filter works, by name.

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
    if method == "cross-channel":
        return {
            "tv_weight": CROSS_TV_WEIGHT,
            "cross_weight": CROSS_WEIGHT,
            "tv_step": TV_STEP,
            "rounds": CROSS_ROUNDS,
        }
    raise UnsupportedError(f"method must be rl, admm-tv or cross-channel; got {method!r}")


def richardson_lucy_filter(
    noise: NoiseModel,
    *,
    rounds: int | None = None,
    rounds_per_snr: float = RL_ROUNDS_PER_SNR,
) -> BlockFilter:
    """Return Richardson-Lucy as a block filter.

    Args:
        noise: Noise after white balance.
        rounds: Each sharpens and raises noise; None lets the signal-to-noise ratio of the block
            decide.
        rounds_per_snr: How many rounds that is, within limits.
    """
    background = background_of(noise)
    shot, read_variance = np.array(noise.shot), np.array(noise.read_variance)

    def restore(block: Block) -> FloatArray:
        level = np.maximum(block.samples.mean(axis=(-2, -1), dtype=np.float64), 0)
        deviation = np.sqrt(np.maximum(shot * level + read_variance, 1e-20))
        ideal_rounds = rounds_per_snr * float((level / deviation).mean())
        count = (
            int(np.clip(ideal_rounds, RL_LEAST_ROUNDS, RL_MOST_ROUNDS))
            if rounds is None
            else rounds
        )
        clipped = None if block.unknown is None else spread_clipped(block.unknown)
        return richardson_lucy(block.samples, block.otf, background, count, clipped)

    return restore

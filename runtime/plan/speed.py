"""The speed of this machine: one window of each network and one block of the bank, timed."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, taper_edges
from camkit.runtime.bank.wiener import place_knowledge, wiener_filter
from camkit.runtime.network.engine import NetworkEngine

WINDOW_PX: Final = 320
"""Side of the timed window, as near as the stride of a network allows."""
WINDOW_BYTES: Final = 100_000_000
"""Most memory of a timed window; that of a wide network is smaller."""
ROUNDS: Final = 3
REST_BLOCKS_PER_MP: Final = 40.0
"""Everything but bank and network, per megapixel, in blocks of REFERENCE_BLOCK_PX (measured)."""
REFERENCE_BLOCK_PX: Final = 384
LARGE_WINDOW: Final = 1.5
"""A pixel of the strips of a picture over one of the timed window, which stays in the cache
(measured: docs/results/plan.md)."""
CROWDING: Final = 1.4
"""Lights explained by all threads at once over one alone (measured: the memory is shared)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Speed:
    """Seconds of the parts of a reconstruction.

    Attributes:
        network_s_per_mp: (role, size) -> seconds per computed megapixel of its input, on the
            engine's threads.
        block_s: Seconds of one block of the bank on one thread.
        clipped_block_s: Those of one with clipped samples.
        rest_s_per_mp: Seconds per megapixel of everything else.
        threads: Threads that restore blocks.
    """

    network_s_per_mp: Mapping[tuple[str, str], float] = field(default_factory=dict)
    block_s: float
    clipped_block_s: float
    rest_s_per_mp: float
    threads: int

    def __post_init__(self) -> None:
        values = [*self.network_s_per_mp.values(), self.block_s, self.rest_s_per_mp]
        values.append(self.clipped_block_s)
        if min(values) <= 0 or self.threads < 1:
            raise ContractError("a speed needs seconds > 0 and at least one thread")


def measure_speed(
    networks: Mapping[tuple[str, str], tuple[NetworkEngine, NetworkFacts]],
    stage: Wiener | None,
    *,
    threads: int,
) -> Speed:
    """Measure the time of one window of every network and one block, the best of ROUNDS each.

    Args:
        networks: By role and size.
        stage: The bank; None times the block of the default one.
        threads: Threads that restore blocks.
    """
    settings = stage or Wiener(prior_scale=1e-3, prior_exponent=2.0)
    # the samples of a block cost about the same whatever its size
    side = min(settings.block_px, REFERENCE_BLOCK_PX)
    block_s, clipped_s = (
        _block_seconds(settings, side, clipped=clipped) for clipped in (False, True)
    )
    larger = (settings.block_px / side) ** 2
    return Speed(
        network_s_per_mp={
            key: LARGE_WINDOW * _seconds_per_mp(*network) for key, network in networks.items()
        },
        block_s=block_s * larger,
        clipped_block_s=(block_s + CROWDING * max(clipped_s - block_s, 0)) * larger,
        rest_s_per_mp=REST_BLOCKS_PER_MP * block_s * (REFERENCE_BLOCK_PX / side) ** 2,
        threads=threads,
    )


def _seconds_per_mp(engine: NetworkEngine, facts: NetworkFacts) -> float:
    """Return the seconds per megapixel of a window, a square of whole strides."""
    fitting = min(WINDOW_PX, int((WINDOW_BYTES / max(facts.bytes_per_pixel, 1)) ** 0.5))
    side = max(fitting // facts.stride_px, 1) * facts.stride_px
    window = np.full((1, engine.channels, side, side), 0.1, np.float32)
    return _best(lambda: engine.run(window)) / (side * side / 1e6)


def _block_seconds(settings: Wiener, block_px: int, *, clipped: bool) -> float:
    noise = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-6,) * 3)
    restore = wiener_filter(settings, noise)
    samples = np.full((3, block_px, block_px), 0.1, np.float32)
    otf = np.full((3, block_px, block_px // 2 + 1), 0.5, np.complex64)
    ring = min(settings.overlap_px // 4, block_px // 8)
    unknown = None
    if clipped:
        unknown = np.zeros((1, block_px, block_px), dtype=np.bool_)
        unknown[0, block_px // 2] = True
    know = place_knowledge(settings)
    knowledge = None if know is None else know(otf, 0.0)

    def block() -> object:
        tapered = taper_edges(samples, otf, ring)
        return restore(Block(samples=tapered, otf=otf, unknown=unknown, knowledge=knowledge))

    return _best(block)


def _best(call: Callable[[], object]) -> float:
    seconds = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - began)
    return max(min(seconds), 1e-6)

"""The speed of the machine: the best of some rounds, per megapixel, refused when it is none."""

import tracemalloc
from dataclasses import replace

import pytest

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.plan.speed import (
    LARGE_WINDOW,
    REST_BLOCKS_PER_MP,
    ROUNDS,
    WINDOW_PX,
    Speed,
    measure_speed,
)
from tests.bundle_factory import tiny_facts, tiny_network

STAGE = Wiener(block_px=64, overlap_px=16, prior_scale=1e-3, prior_exponent=2.0)


class _Clock:
    """Time that passes only when a network lets it."""

    now_s = 0.0

    def perf_counter(self) -> float:
        return self.now_s


class _Network:
    """Takes the seconds it is told to, run by run."""

    def __init__(self, clock: _Clock, *seconds: float, channels: int = 6) -> None:
        self.clock, self.seconds, self.channels = clock, list(seconds), channels
        self.shapes: list[tuple[int, ...]] = []

    def run(self, window: FloatArray) -> FloatArray:
        self.shapes.append(window.shape)
        self.clock.now_s += self.seconds.pop(0)
        return window[:, :3]


def _with_facts(
    engines: dict[tuple[str, str], _Network], **facts: object
) -> dict[tuple[str, str], tuple[NetworkEngine, NetworkFacts]]:
    changed = tiny_facts().model_copy(update=facts)
    return {key: (engine, changed) for key, engine in engines.items()}  # type: ignore[misc]


@pytest.mark.parametrize(
    ("facts", "side"),
    [({"stride_px": 7}, 315), ({"stride_px": 640}, 640), ({"bytes_per_pixel": 20_000.0}, 70)],
)
def test_the_timed_window_respects_stride_and_memory(facts: dict[str, object], side: int) -> None:
    network = _Network(_Clock(), *[0.1] * ROUNDS)
    measure_speed(_with_facts({("restore", "M"): network}, **facts), STAGE, threads=1)
    assert set(network.shapes) == {(1, 6, side, side)}


def test_a_block_larger_than_any_picture_is_not_made_to_be_timed() -> None:
    huge = STAGE.model_copy(update={"block_px": 8192, "overlap_px": 4096})
    tracemalloc.start()
    speed = measure_speed({}, huge, threads=1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6
    assert speed.block_s > 100 * measure_speed({}, STAGE, threads=1).block_s


def test_a_block_with_clipped_samples_takes_longer() -> None:
    speed = measure_speed({}, STAGE.model_copy(update={"clip_iterations": 6}), threads=1)
    assert speed.clipped_block_s > 1.5 * speed.block_s


def test_a_window_counts_with_its_best_round_per_megapixel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = _Clock()
    monkeypatch.setattr("camkit.runtime.plan.speed.time", clock)
    engines = {
        ("split", "M"): _Network(clock, 0.9, 0.6, 0.7),
        ("fuse", "M"): _Network(clock, 0.2, 0.3, 0.4, channels=4),
    }
    speed = measure_speed(_with_facts(engines), STAGE, threads=2)
    megapixels = WINDOW_PX**2 / 1e6
    assert speed.network_s_per_mp["split", "M"] == pytest.approx(LARGE_WINDOW * 0.6 / megapixels)
    assert speed.network_s_per_mp["fuse", "M"] == pytest.approx(LARGE_WINDOW * 0.2 / megapixels)
    assert engines["split", "M"].shapes == [(1, 6, WINDOW_PX, WINDOW_PX)] * ROUNDS
    assert engines["fuse", "M"].shapes == [(1, 4, WINDOW_PX, WINDOW_PX)] * ROUNDS
    assert speed.threads == 2


def test_a_real_network_and_the_default_block_are_timed() -> None:
    engine = NetworkEngine(tiny_network(), threads=1)
    speed = measure_speed({("restore", "M"): (engine, tiny_facts())}, None, threads=1)
    assert speed.network_s_per_mp["restore", "M"] > 0
    assert speed.block_s > 1e-5


def test_the_rest_is_given_in_blocks_of_one_size_whatever_the_bank_has() -> None:
    small = measure_speed({}, STAGE, threads=1)
    large = measure_speed({}, STAGE.model_copy(update={"block_px": 256}), threads=1)
    assert large.block_s > small.block_s
    assert small.rest_s_per_mp / small.block_s == pytest.approx(
        REST_BLOCKS_PER_MP * (384 / 64) ** 2
    )
    assert large.rest_s_per_mp / large.block_s == pytest.approx(
        REST_BLOCKS_PER_MP * (384 / 256) ** 2
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"block_s": 0.0},
        {"rest_s_per_mp": -1.0},
        {"threads": 0},
        {"network_s_per_mp": {("restore", "M"): 0.0}},
    ],
)
def test_a_speed_without_time_or_threads_is_refused(wrong: dict[str, object]) -> None:
    sound = Speed(
        network_s_per_mp={}, block_s=0.01, clipped_block_s=0.05, rest_s_per_mp=0.1, threads=1
    )
    with pytest.raises(ContractError, match="seconds > 0"):
        replace(sound, **wrong)  # type: ignore[arg-type]

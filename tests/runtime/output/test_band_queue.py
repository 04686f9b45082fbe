"""Bands on their way to a writer on another thread: order, errors, and no thread left behind."""

import threading
from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage
from camkit.runtime.output.band_queue import WAITING_BANDS, BandQueue
from camkit.runtime.output.picture_writer import Codes, PictureFormat, PictureWriter

HEIGHT = 12


class Collector(PictureWriter):
    """Keeps what it is given, and fails at a row if told so."""

    def __init__(self, fails_at: int | None = None) -> None:
        super().__init__(
            Path("nowhere"), PictureFormat(width=5, height=HEIGHT, color=color_stage(None))
        )
        self.stored: list[Codes] = []
        self.fails_at = fails_at
        self.threads: set[str] = set()
        self.gate = threading.Event()
        self.gate.set()

    def encode(self, band: FloatArray) -> Codes:
        self.gate.wait(20)
        self.threads.add(threading.current_thread().name)
        if self.fails_at == len(self.stored):
            raise OSError("disk full")
        return band

    def store(self, rows: Codes) -> None:
        self.stored.append(rows)

    def finish(self) -> None:
        pass

    def release(self) -> None:
        pass


def bands() -> list[FloatArray]:
    picture = np.random.default_rng(0).random((3, HEIGHT, 5), dtype=np.float32)
    return [picture[:, row : row + 1] for row in range(HEIGHT)]


def test_bands_arrive_in_order_on_one_other_thread() -> None:
    given, before = bands(), threading.active_count()
    with Collector() as writer, BandQueue(writer) as queue:
        for band in given:
            queue.write(band)
    np.testing.assert_array_equal(np.concatenate(writer.stored, 1), np.concatenate(given, 1))
    assert len(writer.threads) == 1
    assert threading.current_thread().name not in writer.threads
    assert threading.active_count() == before


@pytest.mark.parametrize("fails_at", [0, HEIGHT - 1])
def test_an_error_of_the_writer_reaches_who_hands_it_bands(fails_at: int) -> None:
    before = threading.active_count()
    writer = Collector(fails_at)

    def run() -> None:
        with writer, BandQueue(writer) as queue:
            for band in bands():
                queue.write(band)

    with pytest.raises(OSError, match="disk full"):
        run()
    assert threading.active_count() == before


def test_after_an_error_of_the_caller_waiting_bands_are_dropped() -> None:
    before = threading.active_count()
    writer = Collector()
    writer.gate.clear()

    def run() -> None:
        with writer, BandQueue(writer) as queue:
            for band in bands()[:WAITING_BANDS]:
                queue.write(band)
            threading.Timer(0.2, writer.gate.set).start()
            raise ContractError("cancelled")

    with pytest.raises(ContractError, match="cancelled"):
        run()
    assert len(writer.stored) < WAITING_BANDS
    assert not [t for t in threading.enumerate() if t.name.startswith("camkit-writer")]
    assert threading.active_count() <= before + 1  # the timer may be ending


def test_no_more_than_a_few_bands_wait() -> None:
    writer, taken = Collector(), []
    writer.gate.clear()

    def produce() -> None:
        with writer, BandQueue(writer) as queue:
            for band in bands():
                queue.write(band)
                taken.append(band)

    producer = threading.Thread(target=produce)
    producer.start()
    producer.join(0.3)
    assert producer.is_alive()
    assert len(taken) <= WAITING_BANDS
    writer.gate.set()
    producer.join(20)
    assert len(taken) == HEIGHT

"""Pile-up is undone where anything is left to undo it with, and told where nothing is."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pile_up import without_pile_up

RATE = 0.02 + 0.2 * np.exp(-0.5 * ((np.arange(60) - 25) / 4) ** 2)


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
def test_counts_of_photons_drawn_one_by_one_come_back(orientation: str) -> None:
    cycles, rng = 100_000, np.random.default_rng(1)
    fired = rng.poisson(np.broadcast_to(RATE, (cycles, 60))) > 0
    if orientation == "histogram":  # only the first bin of a cycle in which one came
        fired &= np.cumsum(fired, axis=1) == 1
    counts = fired.sum(axis=0, dtype=np.float32)[None]
    found = without_pile_up(counts, cycles, orientation)  # type: ignore[arg-type]
    left = cycles * (np.exp(-np.concatenate([[0], np.cumsum(RATE)[:-1]])))
    noise = np.sqrt(RATE / (left if orientation == "histogram" else cycles))
    assert (np.abs(found.counts[0] / cycles - RATE) < 5 * noise + 1e-4).all()
    # without the correction the same counts are far off
    assert np.abs(counts[0] / cycles - RATE).max() > 0.02


def test_what_was_drowned_is_told() -> None:
    counts = np.zeros((3, 10), np.float32)
    counts[0, 2] = 999
    counts[1, 2] = 10
    found = without_pile_up(counts, 1000, "histogram")
    assert found.blind.tolist() == [True, False, False]
    np.testing.assert_allclose(found.worst, [0.999, 0.01, 0])
    assert np.isfinite(found.counts).all()
    # full in every cycle but one: at least so many, and none that later bins could tell
    assert found.counts[0, 2] == pytest.approx(-1000 * np.log(0.02), rel=1e-5)
    assert not found.counts[0, 3:].any()


def test_a_full_gate_is_brighter_than_one_that_is_nearly_full() -> None:
    counts = np.array([[50, 90, 97, 99, 100]], np.float32)
    found = without_pile_up(counts, 100, "gate")
    assert (np.diff(found.counts[0])[:3] > 0).all()
    assert found.counts[0, 4] == found.counts[0, 3] == pytest.approx(-100 * np.log(0.02))


def test_few_counts_of_many_cycles_stay_as_they_are() -> None:
    counts = np.random.default_rng(0).poisson(3, (4, 30)).astype(np.float32)
    found = without_pile_up(counts, 10**9, "histogram")
    np.testing.assert_allclose(found.counts, counts, rtol=1e-6)


def test_more_counts_than_cycles_are_refused() -> None:
    with pytest.raises(ContractError, match="go up to 30, above the 20 cycles"):
        without_pile_up(np.full((2, 10), 3, np.float32), 20, "histogram")
    assert not without_pile_up(np.full((2, 10), 3, np.float32), 20, "gate").blind.any()
    with pytest.raises(ContractError, match="cycles must be >= 1"):
        without_pile_up(np.zeros((2, 10), np.float32), 0, "gate")

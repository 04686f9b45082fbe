"""Counts of the twin: means, dark counts, hot pixels, and what blind times hide."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.twin.counting import (
    Disturbances,
    count_frames,
    count_times,
    scaled_to,
)

RNG = np.random.default_rng


def test_counts_have_the_mean_and_the_variance_of_poisson() -> None:
    counts = count_frames(np.full((400, 8, 8), 20.0), Disturbances(dark=5.0), RNG(0))
    assert counts.mean() == pytest.approx(25.0, rel=0.01)
    assert counts.var() == pytest.approx(25.0, rel=0.03)


def test_hot_pixels_count_without_light() -> None:
    hot = np.zeros((4, 4), dtype=bool)
    hot[1, 2] = True
    dark = np.zeros((200, 4, 4))
    counts = count_frames(dark, Disturbances(dark=1.0, hot=hot), RNG(0))
    assert counts[:, 1, 2].mean() == pytest.approx(51.0, rel=0.05)
    stated = count_frames(dark, Disturbances(dark=1.0, hot=hot, hot_counts=9.0), RNG(0))
    assert stated[:, 1, 2].mean() == pytest.approx(10.0, rel=0.1)


def test_a_dead_time_takes_its_share() -> None:
    counts = count_frames(np.full((300, 5, 5), 100.0), Disturbances(dead_share=0.01), RNG(0))
    assert counts.mean() == pytest.approx(100 / 2, rel=0.01)


def test_a_gate_answers_once_a_cycle() -> None:
    counts = count_times(np.full((300, 5, 5), 80.0), "gate", Disturbances(cycles=100), RNG(0))
    assert counts.max() <= 100
    assert counts.mean() == pytest.approx(100 * (1 - np.exp(-0.8)), rel=0.01)


@pytest.mark.parametrize("orientation", ["gate", "histogram"])
def test_what_pile_up_hides_is_brought_back(orientation: str) -> None:
    """By the correction that process makes: the light of every bin, early and late."""
    light = np.linspace(5.0, 40.0, 12)[:, None, None] * np.ones((1, 30, 30))
    found = count_times(light, orientation, Disturbances(cycles=1000), RNG(1))  # type: ignore[arg-type]
    counts = np.ascontiguousarray(found.reshape(12, -1).T, dtype=np.float32)
    if orientation == "histogram":
        assert found[-1].mean() < 0.85 * light[-1, 0, 0]
    corrected = without_pile_up(counts, 1000, orientation)  # type: ignore[arg-type]
    assert not corrected.blind.any()
    np.testing.assert_allclose(corrected.counts.mean(axis=0), light[:, 0, 0], rtol=0.05)


def test_light_is_scaled_to_photons_of_a_pixel() -> None:
    light = RNG(0).random((10, 4, 5)).astype(np.float32)
    assert scaled_to(light, 70.0).sum(axis=0).mean() == pytest.approx(70.0)
    with pytest.raises(ContractError, match="sends no light"):
        scaled_to(np.zeros((10, 4, 5), np.float32), 70.0)


def test_counts_that_no_reader_takes_are_refused() -> None:
    bright = np.full((9, 2, 2), 1e10)
    for count in (
        lambda: count_frames(bright, Disturbances(), RNG(0)),
        lambda: count_frames(bright * 1e290, Disturbances(), RNG(0)),
        lambda: count_times(bright, "histogram", Disturbances(), RNG(0)),
        lambda: count_times(bright, "gate", Disturbances(cycles=2**30), RNG(0)),
    ):
        with pytest.raises(ContractError, match=r"captures hold at most 16777216; take fewer"):
            count()
    assert count_frames(bright[0, 0] * 1.6e-3, Disturbances(), RNG(0)).max() < 2**24
    assert count_times(bright, "gate", Disturbances(cycles=100), RNG(0)).max() == 100


@pytest.mark.parametrize("changes", [{"dark": -1.0}, {"dead_share": np.inf}, {"cycles": -1}])
def test_disturbances_that_cannot_be_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises(ContractError, match=next(iter(changes))):
        Disturbances(**changes)  # type: ignore[arg-type]

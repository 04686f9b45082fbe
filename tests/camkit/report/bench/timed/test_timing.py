"""Seconds: quantiles, the noise flag, fair orders and paired ratios."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.report.bench.timed.timing import (
    interleaved,
    is_noisy,
    paired_ratio,
    quantile,
    spread_of,
)


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=30), st.floats(0, 1))
def test_quantiles_are_those_of_numpy(values: list[float], share: float) -> None:
    assert quantile(values, share) == pytest.approx(np.quantile(values, share), rel=1e-9, abs=1e-9)


def test_a_quantile_of_nothing_is_refused() -> None:
    with pytest.raises(ContractError, match="needs values"):
        quantile([], 0.5)
    with pytest.raises(ContractError, match="share"):
        quantile([1.0], 1.1)


def test_order_statistics_of_one_to_eleven() -> None:
    spread = spread_of([11.0, *map(float, range(1, 11))])
    assert spread is not None
    assert (spread.n, spread.first, spread.least, spread.median, spread.p90) == (11, 11, 1, 6, 10)
    assert spread_of([]) is None


def test_p99_is_given_from_a_hundred_values_on() -> None:
    few, many = spread_of([1.0] * 99), spread_of([*([1.0] * 99), 2.0])
    assert few is not None
    assert few.p99 is None
    assert many is not None
    assert many.p99 == pytest.approx(1.01)


@pytest.mark.parametrize(
    ("seconds", "load", "noisy"),
    [
        ([1.0, 1.0, 1.0], 0.0, False),
        ([1.0, 1.0, 1.3], 0.0, True),  # p90 = 1.24
        ([1.0, 1.0, 1.1], 0.05, False),  # p90 = 1.08
        ([1.0, 1.0, 1.0], 0.11, True),
        ([1.0], 0.0, False),
        ([1.0], None, None),
        ([], 0.0, None),
    ],
)
def test_spread_and_load_make_a_row_noisy(
    seconds: list[float], load: float | None, noisy: bool | None
) -> None:
    assert is_noisy(spread_of(seconds), load) is noisy


def test_a_steady_drift_falls_on_all_items_alike() -> None:
    order = list(interleaved("abc", 4))
    places = {item: sum(i for i, o in enumerate(order) if o == item) for item in "abc"}
    assert sorted(order) == sorted("abc" * 4)
    assert len(set(places.values())) == 1


def test_ratios_are_taken_round_by_round() -> None:
    assert paired_ratio([2.0, 20.0, 6.0], [1.0, 10.0, 2.0]) == 2.0
    assert paired_ratio([2.0], [1.0, 1.0]) is None
    assert paired_ratio([], []) is None

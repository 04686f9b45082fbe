"""Seconds as people should read them: order of the rounds, quantiles, and whether to trust them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

from camkit.errors import ContractError

NOISY_SPREAD: Final = 1.15
"""p90 over median above which a row is called noisy."""
NOISY_LOAD: Final = 0.10
"""Share of the machine's processor time taken by others above which a row is called noisy."""
LEAST_N_OF_P99: Final = 100

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Order statistics of repeated measurements, in seconds.

    Attributes:
        n: How many.
        first: The first one, with whatever was cold.
        least: The smallest.
        median: The middle.
        p90: 0.9 quantile.
        p99: 0.99 quantile; None for fewer than 100.
    """

    n: int
    first: float
    least: float
    median: float
    p90: float
    p99: float | None


def quantile(values: Sequence[float], share: float) -> float:
    """Return a quantile, linear between the order statistics.

    Args:
        values: At least one.
        share: 0 smallest, 1 largest.

    Raises:
        ContractError: If there is no value or the share lies outside 0..1.

    References: Hyndman and Fan 1996, definition 7.
    """
    if not values or not 0 <= share <= 1:
        raise ContractError(
            f"a quantile needs values and a share in 0..1; got {len(values)}, {share}"
        )
    ordered = sorted(values)
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def spread_of(seconds: Sequence[float]) -> Spread | None:
    """Return the order statistics of measurements in the order in which they were made."""
    if not seconds:
        return None
    return Spread(
        n=len(seconds),
        first=seconds[0],
        least=min(seconds),
        median=quantile(seconds, 0.5),
        p90=quantile(seconds, 0.9),
        p99=quantile(seconds, 0.99) if len(seconds) >= LEAST_N_OF_P99 else None,
    )


def is_noisy(spread: Spread | None, load_of_others: float | None) -> bool | None:
    """Return whether seconds are not to be trusted: they vary, or others used the machine.

    Args:
        spread: Of the seconds.
        load_of_others: Share of the machine's processor time that others took; None if unknown.

    Returns:
        None where neither can be told: no measurement, or a single one and an unknown load.
    """
    if spread is None or (spread.n < 2 and load_of_others is None):
        return None
    varies = spread.n >= 2 and spread.p90 > NOISY_SPREAD * spread.median
    return varies or (load_of_others is not None and load_of_others > NOISY_LOAD)


def interleaved(items: Sequence[_T], rounds: int) -> Iterator[_T]:
    """Return all items once per round, forwards and backwards in turn.

    A drift of the machine then falls on all of them alike.
    """
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)


def paired_ratio(seconds: Sequence[float], base: Sequence[float]) -> float | None:
    """Return the median over rounds of seconds / base; None unless both have every round."""
    if not seconds or len(seconds) != len(base) or min(base) <= 0:
        return None
    return quantile([s / b for s, b in zip(seconds, base, strict=True)], 0.5)

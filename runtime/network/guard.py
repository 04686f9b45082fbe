"""Every tile of a network's output looked at: finite and bounded, else replaced or refused."""

import math
from collections.abc import Callable
from typing import Final

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.noise import NoiseModel

BOUND_FACTOR: Final = 4.0
BOUND_OFFSET: Final = 1.0
"""An output may reach BOUND_FACTOR times its tile's largest input plus this, in stabilised units:
sixteen times the light. A restored lamp stays far below; networks that explode go far beyond."""
DARK_SPREADS: Final = 16.0
"""What a tile without any light may be given: so many times the noise at black, in electrons."""

Bound = Callable[[float], tuple[float, float]]
"""The largest input of a tile -> least and largest output that is believed; grows with it."""

_SPARSE: Final = 16


class TileGuard:
    """Looks at the tiles of one picture; serves one thread.

    Attributes:
        replaced: Tiles that took the planes that stand in instead, in words.
    """

    def __init__(
        self,
        *,
        fallback: bool,
        stand_in: slice | None = None,
        bound: Bound | None = None,
        inputs: int | None = None,
    ) -> None:
        """Choose what becomes of a bad tile.

        Args:
            fallback: Give the tile the planes that stand in instead of an error.
            stand_in: Which channels of what the network is given stand in for its output; None if
                none can.
            bound: What is believed; None for `plain_bound`.
            inputs: Channels that the network takes of what it is given, the first ones; None for
                all.
        """
        self._inputs = inputs
        self._fallback = fallback and stand_in is not None
        self._stand_in = stand_in
        self._bound = plain_bound() if bound is None else bound
        self.replaced: list[str] = []

    def check(
        self, output: FloatArray, inputs: FloatArray, describe: Callable[[], str]
    ) -> FloatArray:
        """Return the output of a tile if it is sound, else the planes that stand in for it.

        Args:
            output: (k, s h, s w) float32 that the network made of the tile.
            inputs: (c, h, w) float32 that it got.
            describe: Names the tile; called only when it is bad.

        Raises:
            ContractError: If the tile is bad and there is no fallback, or the planes that stand in
                are not finite either.
        """
        trouble = _trouble(output, inputs[: self._inputs], self._bound)
        if trouble is None:
            return output
        tile = describe()
        if not self._fallback or self._stand_in is None:
            hint = "" if self._stand_in is None else _hint()
            raise ContractError(f"the network gave {trouble} in {tile}{hint}")
        instead = inputs[self._stand_in]
        if not is_finite(instead):
            raise ContractError(
                f"the network gave {trouble} in {tile}, and what came before it is not finite "
                "either; the capture holds what no repair found"
            )
        self.replaced.append(f"{tile}: {trouble.rstrip(',')}")
        return instead


def _hint() -> str:
    return (
        f"; {option_text('on_unsafe', 'fallback')} uses the network's input there, "
        f"{option_text('method')} leaves the network out"
    )


def is_finite(planes: FloatArray) -> bool:
    """Return whether no sample is NaN or inf; both survive a minimum and a maximum."""
    return math.isfinite(planes.min()) and math.isfinite(planes.max())


def plain_bound(factor: float = BOUND_FACTOR) -> Bound:
    """Bound an output by a factor of its tile's largest input, to either side."""

    def bound(largest: float) -> tuple[float, float]:
        high = factor * largest + BOUND_OFFSET
        return -high, high

    return bound


def light_bound(most_light: float, noise: NoiseModel, *, scale: float) -> Bound:
    """Bound the light that a stabilised output stands for, whatever the noise says.

    Where read noise is large beside shot noise, the square root is flat: a small step of what the
    network gives is much light, and zero is far below black. So the light itself is bounded: above
    by `most_light` times that of the tile's largest input, below by as much under black as that
    input lies above it, both and what noise gives at black.

    Args:
        most_light: Times the light of its tile that an output may have.
        noise: By which outputs are taken back to light; shot > 0.
        scale: Divisor of `stabilise`.
    """
    square = max(r / s**2 for s, r in zip(noise.shot, noise.read_variance, strict=True))
    dark_e = DARK_SPREADS * (math.sqrt(square) + 1)
    plain = plain_bound(math.sqrt(most_light))

    def bound(largest: float) -> tuple[float, float]:
        least, most = plain(largest)
        light_e = max((largest * scale) ** 2 - square, 0.0)
        high = math.sqrt(most_light * light_e + dark_e + square) / scale
        least_square = square - light_e - dark_e
        return (math.sqrt(least_square) / scale if least_square > 0 else least), min(high, most)

    return bound


def _trouble(output: FloatArray, inputs: FloatArray, bound: Bound) -> str | None:
    """Return the fault of a tile; None if there is none."""
    low, high = float(output.min()), float(output.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        return "NaN or inf"
    # A sound tile is told by some of its rows: the bound of all rows can only be wider.
    for rows in (inputs[:, ::_SPARSE], inputs):
        least, most = bound(max(float(rows.max()), -float(rows.min())))
        if least <= low and high <= most:
            return None
    value, limit = (high, most) if high > most else (low, least)
    return f"values up to {value:.3g}, beyond {limit:.3g},"

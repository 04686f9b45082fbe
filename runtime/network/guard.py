"""Every tile of a network's output looked at: finite and bounded, else replaced or refused."""

import math
from collections.abc import Callable
from typing import Final

from camkit.contracts import FloatArray
from camkit.errors import ContractError

BOUND_FACTOR: Final = 4.0
BOUND_OFFSET: Final = 1.0
"""An output may reach BOUND_FACTOR times its tile's largest input plus this, in stabilised units:
sixteen times the light. A restored lamp stays far below; networks that explode go far beyond."""

_SPARSE: Final = 16
_HINT: Final = (
    "; say --on-unsafe fallback for the Wiener result there, or --method wiener for the whole "
    "picture"
)


class TileGuard:
    """Looks at the tiles of one picture; serves one thread.

    Attributes:
        replaced: Tiles that took the planes that stand in instead, in words.
    """

    def __init__(
        self, *, fallback: bool, stand_in: slice | None = None, factor: float = BOUND_FACTOR
    ) -> None:
        """Choose what becomes of a bad tile.

        Args:
            fallback: Give the tile the planes that stand in instead of an error.
            stand_in: Which channels of what the network is given stand in for its output; None if
                none can.
            factor: Times the largest input of its tile that an output may reach.
        """
        self._fallback = fallback and stand_in is not None
        self._stand_in = stand_in
        self._factor = factor
        self.replaced: list[str] = []

    def check(
        self, output: FloatArray, given: FloatArray, describe: Callable[[], str]
    ) -> FloatArray:
        """Give the output of a tile if it is sound, else the planes that stand in for it.

        Args:
            output: (k, s h, s w) float32 that the network made of the tile.
            given: (c, h, w) float32 that it got.
            describe: Names the tile; called only when it is bad.

        Raises:
            ContractError: If the tile is bad and there is no fallback, or the planes that stand in
                are not finite either.
        """
        trouble = _trouble(output, given, self._factor)
        if trouble is None:
            return output
        tile = describe()
        if not self._fallback or self._stand_in is None:
            hint = "" if self._stand_in is None else _HINT
            raise ContractError(f"the network gave {trouble} in {tile}{hint}")
        instead = given[self._stand_in]
        if not is_finite(instead):
            raise ContractError(
                f"the network gave {trouble} in {tile}, and the Wiener result there is not finite "
                "either; the capture holds what no repair found"
            )
        self.replaced.append(f"{tile}: {trouble}")
        return instead


def is_finite(planes: FloatArray) -> bool:
    """Tell whether no sample is NaN or inf; both survive a minimum and a maximum."""
    return math.isfinite(planes.min()) and math.isfinite(planes.max())


def _trouble(output: FloatArray, given: FloatArray, factor: float) -> str | None:
    """Say what is wrong with a tile; None if nothing is."""
    low, high = float(output.min()), float(output.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        return "NaN or inf"
    largest = max(high, -low)
    # A sound tile is told by some of its rows: the bound of all rows can only be wider.
    if largest <= _bound(given[:, ::_SPARSE], factor) or largest <= (
        bound := _bound(given, factor)
    ):
        return None
    return f"values up to {largest:.3g}, beyond {bound:.3g},"


def _bound(given: FloatArray, factor: float) -> float:
    return factor * max(float(given.max()), -float(given.min())) + BOUND_OFFSET

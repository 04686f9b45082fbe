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

_WIENER: Final = slice(3, 6)
_SPARSE: Final = 16


class TileGuard:
    """Looks at the tiles of one picture; serves one thread.

    Attributes:
        replaced: Tiles that took the Wiener planes instead, in words.
    """

    def __init__(self, *, fallback: bool) -> None:
        """Choose what becomes of a bad tile.

        Args:
            fallback: Give the tile its Wiener planes instead of an error.
        """
        self._fallback = fallback
        self.replaced: list[str] = []

    def check(
        self, output: FloatArray, given: FloatArray, describe: Callable[[], str]
    ) -> FloatArray:
        """Give the output of a tile if it is sound, else its Wiener planes.

        Args:
            output: (3, h, w) float32 that the network made of the tile, stabilised.
            given: (6, h, w) float32 that it got: capture, then Wiener planes.
            describe: Names the tile; called only when it is bad.

        Raises:
            ContractError: If the tile is bad and there is no fallback, or the Wiener planes are
                not finite either.
        """
        trouble = _trouble(output, given)
        if trouble is None:
            return output
        tile = describe()
        if not self._fallback:
            raise ContractError(
                f"the network gave {trouble} in {tile}; say --on-unsafe fallback for the Wiener "
                "result there, or --method wiener for the whole picture"
            )
        wiener = given[_WIENER]
        if not is_finite(wiener):
            raise ContractError(
                f"the network gave {trouble} in {tile}, and the Wiener result there is not finite "
                "either; the capture holds what no repair found"
            )
        self.replaced.append(f"{tile}: {trouble}")
        return wiener


def is_finite(planes: FloatArray) -> bool:
    """Tell whether no sample is NaN or inf; both survive a minimum and a maximum."""
    return math.isfinite(planes.min()) and math.isfinite(planes.max())


def _trouble(output: FloatArray, given: FloatArray) -> str | None:
    """Say what is wrong with a tile; None if nothing is."""
    low, high = float(output.min()), float(output.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        return "NaN or inf"
    largest = max(high, -low)
    # A sound tile is told by some of its rows: the bound of all rows can only be wider.
    if largest <= _bound(given[:, ::_SPARSE]) or largest <= (bound := _bound(given)):
        return None
    return f"values up to {largest:.3g}, beyond {bound:.3g},"


def _bound(given: FloatArray) -> float:
    return BOUND_FACTOR * max(float(given.max()), -float(given.min())) + BOUND_OFFSET

"""A law of a picture, held against a bundle: its worst number, and how much is admitted."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from camkit.bundle.facts import StatedLaw
from camkit.bundle.reader import Bundle

SHARE: Final = "share"
"""Unit of parts of 1; people read them in per cent."""
_SHARES: Final = (SHARE, "%")


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """The worst number that was met.

    Attributes:
        name: Of the law, as the manifest has it.
        worst: The worst number.
        limit: What is admitted; more breaks the law.
        unit: Of both.
        front: The same number of the front end alone; None where there is none.
        where: Where it was met.
        beside_front: Of a number that is a difference from the front end's: words behind one above
            0, and behind one below.
    """

    name: str
    worst: float
    limit: float
    unit: str
    front: float | None = None
    where: str = ""
    beside_front: tuple[str, str] | None = None

    @property
    def is_kept(self) -> bool:
        """Return whether the law is kept; NaN breaks it."""
        return self.worst <= self.limit

    @property
    def excess(self) -> float:
        """Return the excess over the limit; below 0 where the law is kept."""
        return self.worst - self.limit

    def describe(self) -> str:
        """Return the law in words, with the front end and the limit where it is broken."""
        worst, words = self.worst, ""
        if self.beside_front is not None:
            words = f" {self.beside_front[worst < 0]}"
            worst = abs(worst)
        text = f"{self.name.replace('_', ' ')} {number_text(worst, self.unit)}{words}"
        if self.is_kept:
            return text
        if self.front is not None:
            front = number_text(self.front, self.unit)
            text += f" ({front})" if words else f" (front end {front})"
        where = f", {self.where}" if self.where else ""
        return f"{text}: BROKEN (at most {number_text(self.limit, self.unit)}{where})"

    def to_stated(self) -> StatedLaw:
        """Return the manifest's entry of the law."""
        return StatedLaw(
            worst=round(self.worst, 6),
            limit=round(self.limit, 6),
            unit=self.unit,
            kept=self.is_kept,
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "law": self.name,
            "worst": round(self.worst, 6),
            "limit": round(self.limit, 6),
            "unit": self.unit,
            "front_end": None if self.front is None else round(self.front, 6),
            "where": self.where,
            "kept": self.is_kept,
        }


Laws = Callable[[Bundle, str | None, int], tuple[Law, ...] | str]
"""(bundle, size of its networks, threads) -> laws; a text says why none can be held."""


def number_text(value: float, unit: str) -> str:
    """Return a number of a law with its unit, shares in per cent."""
    return f"{100 * value:.2f} %" if unit in _SHARES else f"{value:.3g} {unit}".rstrip()

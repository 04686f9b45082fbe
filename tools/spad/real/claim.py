"""What was measured of a capture, beside its aim."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A number, and what it should be.

    Attributes:
        capture: The file.
        what: What was measured.
        value: The number.
        unit: Its unit; empty for none.
        least: What it should be at least; None for no such aim.
        most: What it should be at most.
    """

    capture: str
    what: str
    value: float
    unit: str = ""
    least: float | None = None
    most: float | None = None

    @property
    def is_met(self) -> bool | None:
        """Return whether the aim is met; None without one."""
        if self.least is None and self.most is None:
            return None
        is_enough = self.least is None or self.value >= self.least
        return bool(is_enough and (self.most is None or self.value <= self.most))

    def row(self) -> dict[str, Any]:
        """Return it as plain JSON values."""
        found = {"capture": self.capture, "what": self.what, "value": float(f"{self.value:.5g}")}
        aims = {"unit": self.unit or None, "least": self.least, "most": self.most}
        told = {name: aim for name, aim in aims.items() if aim is not None}
        return found | told | ({} if self.is_met is None else {"met": self.is_met})


def table(claims: Iterable[Claim]) -> str:
    """Return claims as lines to read."""
    lines = []
    for claim in claims:
        aim = ""
        if claim.least is not None:
            aim = f">= {claim.least:g}"
        elif claim.most is not None:
            aim = f"<= {claim.most:g}"
        verdict = {True: "met", False: "MISSED", None: ""}[claim.is_met]
        value = f"{claim.value:.5g} {claim.unit}".strip()
        lines.append(f"{claim.capture:26} {claim.what:52} {value:>14} {aim:>10} {verdict}".rstrip())
    return "\n".join(lines)

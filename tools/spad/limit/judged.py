"""What became of drawn pixels, and when that counts as broken."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.report.kinds.spad.synthetic import PULSE

Floats = NDArray[np.float64]
MOST_RMSE: Final = 1.5
"""Of the Cramer-Rao bound."""
LEAST_VALID: Final = 0.5
MOST_WRONG: Final = 0.01
"""Of the believed pixels: beyond a gate's width from the truth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """A condition made worse and worse.

    Attributes:
        name: Of the condition.
        unit: Of its values; empty for none.
        points: What was measured at each, from harmless to hard.
    """

    name: str
    unit: str
    points: tuple[dict[str, Any], ...]

    @property
    def breaks_at(self) -> float | str | None:
        """Return the first value from harmless to hard that is broken; None for none."""
        return next((point["value"] for point in self.points if point["broken"]), None)

    def row(self) -> dict[str, Any]:
        """Return it as plain JSON values."""
        breaks = self.breaks_at
        return {"name": self.name, "unit": self.unit, "breaks_at": breaks, "points": self.points}


def judged(
    value: float | str,
    errors_ps: Floats,
    bounds_ps: Floats,
    valid: NDArray[np.bool_],
    **more: float,
) -> dict[str, Any]:
    """Return what became of some pixels.

    Args:
        value: Of the condition.
        errors_ps: (p,).
        bounds_ps: (p,) Cramer-Rao bound of each.
        valid: (p,) whether camkit believes it.
        more: Further numbers to keep.
    """
    kept = np.abs(errors_ps) < PULSE.width_ps
    wrong = float((valid & ~kept).sum() / max(valid.sum(), 1))
    own = valid & kept
    rmse = float(np.sqrt(np.mean((errors_ps[own] / bounds_ps[own]) ** 2))) if own.any() else np.inf
    share = float(valid.mean())
    broken = rmse > MOST_RMSE or share < LEAST_VALID or wrong > MOST_WRONG
    told = {"rmse_over_crb": rmse, "valid": share, "wrong": wrong, **more}
    numbers = {name: None if not np.isfinite(v) else round(float(v), 5) for name, v in told.items()}
    return {"value": value, **numbers, "broken": bool(broken)}


def swept(
    name: str, unit: str, values: Sequence[Any], point: Callable[[Any], dict[str, Any]]
) -> Sweep:
    """Measure a condition at every value."""
    return Sweep(name=name, unit=unit, points=tuple(point(value) for value in values))

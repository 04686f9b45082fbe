"""The predicted loss of a lattice cell, from its content by the bundle's calibration.

    error = exp(level + detail * log(content.blurred_detail) + noise * log(content.noise)
                + field * content.field)

One such line per target stands in the manifest's `plan` as four entries TARGET.TERM: `exact` is the
squared error that size M leaves (sRGB values), every other target what is added to it when a cell
gets only that: `plain` (developed samples), `wiener` (the bank), or a smaller size of network.
Fitted by `tools/plan_report.py calibrate`; docs/guides/plan.md says how well.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.bundle.manifest import Threshold
from camkit.errors import ContractError
from camkit.runtime.content import CellArray, Content

TERMS: Final = ("level", "detail", "noise", "field")
EXACT: Final = "exact"
ADAPTIVE: Final = "adaptive.loss_db"
DRAFT: Final = "draft.loss_db"
WORST_OVER_MEAN: Final = 3.0
"""The calibration bounds the worst loss by three times the mean (0.3 dB and 0.1 dB)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellLosses:
    """Predicted squared errors, summed over the pixels of every cell.

    Attributes:
        exact: (row, column) error that the exact result has.
        extra: Target -> (row, column) error on top of it.
    """

    exact: CellArray
    extra: dict[str, CellArray]

    def allowed(self, loss_db: float) -> float:
        """Return the error that may be added to the whole picture for a loss of `loss_db`."""
        return float(self.exact.sum() * (10 ** (loss_db / 10) - 1))

    def loss_db(self, added: float) -> float:
        """Return the loss of the whole picture when `added` error is added."""
        return float(10 * np.log10(1 + added / self.exact.sum()))


@dataclass(frozen=True, slots=True, kw_only=True)
class LossModel:
    """The calibration of a bundle.

    Attributes:
        lines: Target -> coefficients of TERMS.
        adaptive_db: Predicted loss that keeps 0.1 dB on average and 0.3 dB at worst.
        draft_db: Predicted loss that `draft` may spend.
    """

    lines: dict[str, tuple[float, float, float, float]]
    adaptive_db: float
    draft_db: float

    def __post_init__(self) -> None:
        if EXACT not in self.lines:
            raise ContractError(f"a loss model needs the target {EXACT!r}")
        values = [v for line in self.lines.values() for v in line]
        if not np.isfinite([*values, self.adaptive_db, self.draft_db]).all():
            raise ContractError("a loss model must be finite")

    def predict(self, content: Content) -> CellLosses:
        """Return the predicted errors of every cell."""
        area = content.cell_px
        errors = {name: area * _line(line, content) for name, line in self.lines.items()}
        exact = errors.pop(EXACT)
        return CellLosses(exact=exact, extra=errors)

    def budget_db(self, max_error_db: float) -> float:
        """Return the predicted loss to spend so that the true one stays below a limit at worst."""
        return self.adaptive_db * max_error_db / (WORST_OVER_MEAN * 0.1)


def _line(line: tuple[float, float, float, float], content: Content) -> CellArray:
    level, detail, noise, field = line
    exponent = level + detail * np.log(content.blurred_detail) + noise * np.log(content.noise)
    return np.asarray(np.exp(np.clip(exponent + field * content.field, -60, 20)))


def read_loss_model(plan: Mapping[str, Threshold] | None) -> LossModel | None:
    """Return the calibration in a manifest's `plan`; None if it has none.

    Raises:
        ContractError: If a target lacks one of its terms.
    """
    if plan is None or ADAPTIVE not in plan:
        return None
    targets = {name.rsplit(".", 1)[0] for name in plan if name.rsplit(".", 1)[-1] in TERMS}
    lines = {}
    for target in sorted(targets):
        absent = [term for term in TERMS if f"{target}.{term}" not in plan]
        if absent:
            raise ContractError(
                f"the bundle's plan lacks {target}.{absent[0]}; calibrate it again with "
                "tools/plan_report.py"
            )
        level, detail, noise, field = (plan[f"{target}.{term}"].value for term in TERMS)
        lines[target] = (level, detail, noise, field)
    adaptive = plan[ADAPTIVE].value
    draft = plan[DRAFT].value if DRAFT in plan else 3 * adaptive
    return LossModel(lines=lines, adaptive_db=adaptive, draft_db=draft)


def plan_entries(
    model: LossModel, *, adaptive_cost_db: float, draft_cost_db: float
) -> dict[str, Threshold]:
    """Return a calibration as the entries of a manifest's `plan`; inverse of `read_loss_model`.

    Args:
        model: The calibration.
        adaptive_cost_db: Mean loss measured when `adaptive` spends its budget.
        draft_cost_db: The same of `draft`.
    """
    entries = {
        f"{target}.{term}": Threshold(value=value, cost_db=0.0)
        for target, line in model.lines.items()
        for term, value in zip(TERMS, line, strict=True)
    }
    entries[ADAPTIVE] = Threshold(value=model.adaptive_db, cost_db=max(adaptive_cost_db, 0.0))
    entries[DRAFT] = Threshold(value=model.draft_db, cost_db=max(draft_cost_db, 0.0))
    return entries

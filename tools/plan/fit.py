"""The loss model fitted to measured cells, and the losses that it may be trusted with.

    log error = level + detail * log(detail) + noise * log(noise) + field * field

per target by least squares over all cells, scaled so that the sums of errors agree. Then the
largest predicted loss is sought at which the captures keep MEAN_DB and WORST_DB,
with tiers chosen as the runtime chooses them but at no cost for borders, which skips the most.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from camkit.errors import ContractError
from camkit.runtime.plan.decision import FULL, PLAIN, SMALL, WIENER
from camkit.runtime.plan.loss import EXACT, CellLosses, LossModel
from camkit.runtime.plan.tiers import TierWork, choose_tiers
from tools.plan.cells import CaptureCells

MEAN_DB: Final = 0.07
WORST_DB: Final = 0.21
"""0.7 of the limits 0.1 and 0.3 dB: scenes that were not fitted do somewhat worse."""
DRAFT_MEAN_DB: Final = 0.5
LEAST_EXTRA: Final = 0.01
"""An excess below this share of the exact error counts as this much: logarithms need > 0."""
LEAST_CELL_SHARE: Final = 0.5
_LOSSES_DB: Final = tuple(float(v) for v in np.geomspace(1.0, 0.005, 40))


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A fitted model and how well it does.

    Attributes:
        model: For the manifest.
        captures: How many were measured.
        cells: How many cells were fitted.
        spread: Target -> standard deviation of log(measured / predicted).
        adaptive: (mean, worst) loss in dB of `adaptive` on the captures.
        draft: (mean, worst) loss in dB of the cells of `draft`.
    """

    model: LossModel
    captures: int
    cells: int
    spread: dict[str, float]
    adaptive: tuple[float, float]
    draft: tuple[float, float]


def fit_model(captures: Sequence[CaptureCells], work: TierWork, small: str | None) -> Calibration:
    """Fit the model.

    Args:
        captures: Measured captures, all with the same targets.
        work: What the networks cost.
        small: The target that tier SMALL takes; None without one.

    Raises:
        ContractError: If there are too few cells.
    """
    masks = [_counted(capture) for capture in captures]
    design = np.concatenate([_design(c, m) for c, m in zip(captures, masks, strict=True)])
    if design.shape[0] < 4 * design.shape[1]:
        raise ContractError(f"{design.shape[0]} cells are too few to fit; give more pictures")
    lines, spread = {}, {}
    for target in captures[0].errors:
        errors_per_px = np.concatenate(
            [_per_px(c, target)[m] for c, m in zip(captures, masks, strict=True)]
        )
        lines[target], spread[target] = _fit(design, errors_per_px)
    model = LossModel(lines=lines, adaptive_db=0.0, draft_db=0.0)
    free = replace(work, full_halo_px=0, small_halo_px=0)
    adaptive_db, adaptive = _largest(captures, model, free, small, MEAN_DB, WORST_DB)
    draft_db, draft = _largest(captures, model, free, small, DRAFT_MEAN_DB, 3 * DRAFT_MEAN_DB)
    return Calibration(
        model=replace(model, adaptive_db=adaptive_db, draft_db=draft_db),
        captures=len(captures),
        cells=design.shape[0],
        spread=spread,
        adaptive=adaptive,
        draft=draft,
    )


def _counted(capture: CaptureCells) -> np.ndarray:
    return np.asarray(capture.pixels >= LEAST_CELL_SHARE * capture.pixels.max())


def _design(capture: CaptureCells, mask: np.ndarray) -> np.ndarray:
    content = capture.content
    terms = (
        np.ones(content.shape),
        np.log(content.blurred_detail),
        np.log(content.noise),
        content.field,
    )
    return np.stack([term[mask] for term in terms], axis=1)


def _per_px(capture: CaptureCells, target: str) -> np.ndarray:
    """Return the error per pixel of the exact result, or what a target adds to it."""
    pixels = np.maximum(capture.pixels, 1)
    exact = capture.errors[EXACT] / pixels
    if target == EXACT:
        return np.asarray(np.maximum(exact, 1e-9))
    extra = capture.errors[target] / pixels - exact
    return np.asarray(np.maximum(extra, LEAST_EXTRA * np.maximum(exact, 1e-9)))


def _fit(
    design: np.ndarray, errors_per_px: np.ndarray
) -> tuple[tuple[float, float, float, float], float]:
    """Fit the logarithm, then scale to the sum; give the line and the spread."""
    line, *_ = np.linalg.lstsq(design, np.log(errors_per_px), rcond=None)
    predicted = np.exp(design @ line)
    spread = float(np.std(np.log(errors_per_px / predicted)))
    line[0] += np.log(errors_per_px.sum() / predicted.sum())
    level, detail, noise, field = (float(v) for v in line)
    return (level, detail, noise, field), spread


def _largest(
    captures: Sequence[CaptureCells],
    model: LossModel,
    work: TierWork,
    small: str | None,
    mean_db: float,
    worst_db: float,
) -> tuple[float, tuple[float, float]]:
    """Return the largest predicted loss that keeps both limits, and the losses it leads to."""
    for loss_db in _LOSSES_DB:
        losses_db = [true_loss_db(c, model, work, small, loss_db) for c in captures]
        if np.mean(losses_db) <= mean_db and max(losses_db) <= worst_db:
            return loss_db, (float(np.mean(losses_db)), float(max(losses_db)))
    return _LOSSES_DB[-1], (float(np.mean(losses_db)), float(max(losses_db)))


def true_loss_db(
    capture: CaptureCells, model: LossModel, work: TierWork, small: str | None, loss_db: float
) -> float:
    """Return what a capture really loses when the model may spend `loss_db`."""
    losses = model.predict(capture.content)
    grid = predicted_grid(losses, small)
    labels = choose_tiers(capture.content.cell_px, grid, losses.allowed(loss_db), work)
    if labels is None:
        return 0.0
    measured = np.stack([capture.errors[target] for target in tier_targets(small)])
    got = np.take_along_axis(measured, labels[None].astype(np.intp), axis=0).sum()
    return float(10 * np.log10(got / capture.errors[EXACT].sum()))


def tier_targets(small: str | None) -> tuple[str, ...]:
    """Return the target whose error every tier has; `small` is that of tier SMALL."""
    return "plain", "wiener", EXACT if small is None else small, EXACT


def predicted_grid(losses: CellLosses, small: str | None) -> np.ndarray:
    """Return (tier, row, column): what each tier adds to the error, as predicted."""
    grid = np.full((4, *losses.exact.shape), np.inf)
    grid[FULL] = 0.0
    for tier, target in ((PLAIN, "plain"), (WIENER, "wiener"), (SMALL, small)):
        if target is not None:
            grid[tier] = losses.extra[target]
    return grid

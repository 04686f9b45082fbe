"""The rule for lattice cells: the network, a smaller one, the bank alone, or only development."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.bundle.stages import Network
from camkit.runtime.plan.counted import counted_work
from camkit.runtime.plan.decision import (
    FULL,
    PLAIN,
    SMALL,
    TIER_NAMES,
    WIENER,
    Decision,
    Labels,
    Subject,
    Work,
)
from camkit.runtime.plan.estimate import tier_work_of
from camkit.runtime.plan.loss import CellLosses, read_loss_model
from camkit.runtime.plan.tiers import LEAST_SAVING, FloatGrid, choose_tiers
from camkit.runtime.plan.ways import known_stand_in

ORDER: Final = 20


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Divide the cells among the tiers within the loss that may be spent.

    What is chosen must save work against the whole picture in strips, its windows counted.
    """
    if not work.networks or subject.role is None or subject.side_px > 1:
        return work, None
    model = read_loss_model(subject.bundle.manifest.plan)
    if subject.content is None:
        reason = f"quality {subject.options.quality} skips nothing"
        return work, Decision(what="cells", choice="all full", reason=reason)
    if operators := subject.global_text(subject.bundle.manifest.sizes):
        reason = f"a network looks at the whole picture ({operators})"
        return work, Decision(what="cells", choice="all full", reason=reason)
    if model is None:
        reason = "the bundle carries no calibrated plan (tools/plan_report.py calibrate writes it)"
        return work, Decision(what="cells", choice="all full", reason=reason)
    if subject.loss_db <= 0:
        return work, Decision(what="cells", choice="all full", reason="no loss is allowed")
    manifest = subject.bundle.manifest
    if not all(known_stand_in(s, manifest.all_planes) for s in manifest.stages_of(Network)):
        reason = "the bundle has no substitute for the network's result"
        return work, Decision(what="cells", choice="all full", reason=reason)
    losses = model.predict(subject.content)
    small = _smaller(subject, work, losses)
    with_small = replace(work, small=small)
    grid = _losses(losses, work.size, small, subject.content.shape)
    base = losses.extra.get(work.size)
    base_loss = 0.0 if base is None else float(base.sum())
    allowed = losses.allowed(subject.loss_db) - base_loss
    labels = None
    if allowed > 0:
        labels = choose_tiers(
            subject.content.cell_px, grid, allowed, tier_work_of(subject, with_small)
        )
    skipping = with_small if labels is None else _skipping(subject, with_small, labels)
    limit = (1 - LEAST_SAVING) * counted_work(subject, work)
    if labels is None or counted_work(subject, skipping) > limit:
        reason = f"nothing can be skipped within {subject.loss_db:.3f} dB"
        return work, Decision(what="cells", choice="all full", reason=reason)
    added = float(np.take_along_axis(grid, labels[None].astype(np.intp), axis=0).sum())
    counts = [f"{int((labels == t).sum())} {TIER_NAMES[t]}" for t in (FULL, SMALL, WIENER, PLAIN)]
    return skipping, Decision(
        what="cells",
        choice=", ".join(c for c in counts if not c.startswith("0 ")),
        reason=f"flat, dark or out of focus; predicted within {subject.loss_db:.3f} dB",
        cost_db=losses.loss_db(base_loss + added) - losses.loss_db(base_loss),
    )


def _skipping(subject: Subject, work: Work, labels: Labels) -> Work:
    """Return the work with tiers; without the stages of networks where no cell has one."""
    labelled = replace(work, labels=labels)
    if labelled.sizes():
        return labelled
    unwanted = {stage.type for stage in subject.bundle.manifest.stages_of(Network)}
    return replace(labelled, networks=False, left_out=work.left_out | unwanted)


def _smaller(subject: Subject, work: Work, losses: CellLosses) -> str | None:
    """Return the smallest calibrated size below the one in use."""
    manifest = subject.bundle.manifest
    mac = {size: manifest.mac_per_pixel(size) for size in manifest.sizes}
    calibrated = [size for size in mac if size in losses.extra and mac[size] < mac[work.size]]
    return min(calibrated, key=lambda size: mac[size]) if calibrated else None


def _losses(losses: CellLosses, size: str, small: str | None, shape: tuple[int, int]) -> FloatGrid:
    """Return (tier, row, column): what each tier adds to the error of the size in use."""
    grid = np.full((4, *shape), np.inf)
    grid[FULL] = 0.0
    base = losses.extra.get(size, np.zeros(shape))
    targets = ((PLAIN, "plain"), (WIENER, "wiener"), (SMALL, small))
    for tier, name in targets:
        if name is not None and name in losses.extra:
            grid[tier] = np.maximum(losses.extra[name] - base, 0.0)
    return grid

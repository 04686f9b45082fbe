"""The saving of an oracle that knows the loss of every cell beforehand, beside that of the plan.

    measured cells -> tiers within a loss a capture -> windows counted -> share of the work saved

Both are counted alike: windows of networks with their halos, blocks of the bank, against the whole
picture in strips.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.runtime.geometry.placement import Placement
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.options import Options
from camkit.runtime.plan.counted import counted_work
from camkit.runtime.plan.decision import FULL, Labels, Subject, Work
from camkit.runtime.plan.loss import EXACT, LossModel
from camkit.runtime.plan.rules.size import REFERENCE
from camkit.runtime.plan.tiers import LEAST_SAVING, FloatGrid, TierWork, choose_tiers
from tools.plan.cells import CaptureCells
from tools.plan.fit import predicted_grid, tier_targets

TIERS: Final = ("plain", "bank", "S", "M")
ORACLE_DB: Final = 0.1
"""Loss of a capture that the oracle may spend."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """One capture by an oracle or by a plan.

    Attributes:
        name: Of the capture.
        loss_db: What it really loses.
        saved: Share of the work of bank and networks.
        tiers: Share of the cells of every tier.
    """

    name: str
    loss_db: float
    saved: float
    tiers: tuple[float, ...]


def oracle_saving(capture: CaptureCells, bundle: Bundle, work: TierWork, small: str) -> Saving:
    """Return what an oracle saves within `ORACLE_DB`."""
    measured = _measured(capture, small)
    losses = np.maximum(measured - capture.errors[EXACT], 0.0)
    allowed = float(capture.errors[EXACT].sum() * (10 ** (ORACLE_DB / 10) - 1))
    labels = choose_tiers(capture.content.cell_px, losses, allowed, work)
    return _saving(capture, bundle, labels, small)


def plan_saving(
    capture: CaptureCells, bundle: Bundle, work: TierWork, small: str, model: LossModel
) -> Saving:
    """Return what the plan of a calibrated bundle saves."""
    losses = model.predict(capture.content)
    allowed = losses.allowed(model.adaptive_db)
    grid = predicted_grid(losses, small)
    labels = choose_tiers(capture.content.cell_px, grid, allowed, work)
    return _saving(capture, bundle, labels, small)


def summary_line(name: str, savings: Sequence[Saving]) -> str:
    """Return mean saving, mean and worst loss of some captures for people."""
    losses_db = [saving.loss_db for saving in savings]
    tiers = np.mean([saving.tiers for saving in savings], axis=0)
    return (
        f"{name:8s} {len(savings):3d} captures: saves {np.mean([s.saved for s in savings]):.1%}, "
        f"loses {np.mean(losses_db):.3f} dB on average, {max(losses_db):.3f} dB at worst; cells "
        + ", ".join(f"{n} {share:.0%}" for n, share in zip(TIERS, tiers, strict=True))
    )


def _saving(capture: CaptureCells, bundle: Bundle, labels: Labels | None, small: str) -> Saving:
    height, width = capture.content.height_px, capture.content.width_px
    window = SensorWindow(
        size_px=(width, height), origin_px=(0, 0), sensor_size_px=(width, height), pitch_um=1.0
    )
    subject = Subject(
        bundle=bundle,
        options=Options(),
        height_px=height,
        width_px=width,
        placement=Placement(window=window),
    )
    exact = Work(size=REFERENCE)
    everything = counted_work(subject, exact)
    saved = 0.0
    if labels is not None:
        done = replace(exact, small=small, labels=labels)
        saved = 1 - counted_work(subject, replace(done, networks=bool(done.sizes()))) / everything
    if labels is None or saved < LEAST_SAVING:
        labels, saved = np.full(capture.pixels.shape, FULL, np.int8), 0.0
    left = np.take_along_axis(_measured(capture, small), labels[None].astype(np.intp), axis=0)
    return Saving(
        name=capture.name,
        loss_db=float(10 * np.log10(left.sum() / capture.errors[EXACT].sum())),
        saved=saved,
        tiers=tuple(float(np.mean(labels == tier)) for tier in range(FULL + 1)),
    )


def _measured(capture: CaptureCells, small: str) -> FloatGrid:
    """Return (tier, row, column): the error of every tier."""
    return np.stack([capture.errors[target] for target in tier_targets(small)])

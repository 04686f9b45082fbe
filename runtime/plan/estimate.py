"""Seconds and peak memory of a piece of work, before it is done."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from camkit.bundle.stages import Undistort, Wiener
from camkit.runtime.bank.blocks import plan_spans
from camkit.runtime.plan.blocks import plain_share
from camkit.runtime.plan.decision import FULL, SMALL, Case, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.tiers import TierWork, work_shares

CLIPPED_BLOCK: Final = 3.3
"""A block with clipped samples costs so many of one without (six rounds of Richardson-Lucy)."""
WINDOW_OVERLAP: Final = 1.15
"""Computed over kept pixels of a usual plan, where no windows are planned yet."""
BLOCK_SET_UP: Final = 1.25
"""A block with its kernel, window and sum over a block that is only filtered."""
UNDISTORT_SHARE: Final = 0.25
"""Share of undistortion in everything but bank and network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What a piece of work will take.

    Attributes:
        seconds: From reading the file to its picture.
        peak_mb: Peak memory of the process.
    """

    seconds: float
    peak_mb: float

    def to_json(self) -> dict[str, Any]:
        """Give plain JSON values."""
        return {"seconds": round(self.seconds, 4), "peak_mb": round(self.peak_mb, 1)}

    def compare(self, seconds: float, peak_mb: float) -> dict[str, Any]:
        """Give the estimate with what really was and the ratio real / estimated."""
        return {
            **self.to_json(),
            "real_seconds": round(seconds, 4),
            "real_peak_mb": round(peak_mb, 1),
            "seconds_ratio": round(seconds / max(self.seconds, 1e-9), 3),
            "peak_ratio": round(peak_mb / max(self.peak_mb, 1e-9), 3),
        }


def estimate_seconds(
    case: Case, work: Work, speed: Speed, window_mp: Mapping[str, float] | None = None
) -> float:
    """Give the seconds of a piece of work.

    Args:
        case: The capture.
        work: What will be done.
        speed: How fast the machine is.
        window_mp: Size -> megapixels that its windows compute, once they are planned.
    """
    rest = speed.rest_s_per_mp * case.megapixels
    if case.bundle.manifest.stage(Undistort) is None or not work.undistort:
        rest *= 1 - UNDISTORT_SHARE
    if window_mp is None:
        window_mp = nominal_window_mp(case, work)
    network = sum(speed.network_s_per_mp[size] * mp for size, mp in window_mp.items())
    return rest + _bank_seconds(case, work, speed) + network


def nominal_window_mp(case: Case, work: Work) -> dict[str, float]:
    """Give size -> megapixels computed, from the lattice alone."""
    computed = case.megapixels * WINDOW_OVERLAP
    if work.method != "net":
        return {}
    if work.labels is None or case.scene is None:
        return {work.size: computed}
    areas = case.scene.cell_px
    tier_work = tier_work_of(case, work)
    found = {}
    for tier, size in ((FULL, work.size), (SMALL, work.small)):
        if size is None or not (work.labels == tier).any():
            continue
        only = work.labels.copy()
        only[work.labels != tier] = 1
        _, share = work_shares(only, areas, tier_work)
        full = tier_work.per_px()
        ratio = (full[FULL] - full[1]) / (full[tier] - full[1])
        found[size] = min(share * ratio, 1.0) * computed
    return found


def tier_work_of(case: Case, work: Work) -> TierWork:
    """Give what the tiers of a piece of work cost, from the bundle's facts."""
    full = case.bundle.network_facts(work.size)
    small = None if work.small is None else case.bundle.network_facts(work.small)
    return TierWork(
        full_mac=full.mac_per_pixel,
        full_halo_px=full.reach_px,
        small_mac=None if small is None else small.mac_per_pixel,
        small_halo_px=0 if small is None else small.reach_px,
    )


def _bank_seconds(case: Case, work: Work, speed: Speed) -> float:
    stage = case.bundle.manifest.stage(Wiener)
    if stage is None:
        return 0.0
    rows = plan_spans(case.height_px, stage.block_px, stage.overlap_px)
    columns = plan_spans(case.width_px, stage.block_px, stage.overlap_px)
    blocks = float(len(rows) * len(columns))
    if work.labels is not None:
        reach = max((case.bundle.network_facts(s).reach_px for s in work.sizes()), default=0)
        blocks *= 1 - plain_share(work.labels, reach, rows, columns)
    if case.scene is not None and stage.clip_iterations:
        clipped = float((case.scene.clipped > 0).mean())
        blocks *= 1 + (CLIPPED_BLOCK - 1) * min(1.0, clipped * (stage.block_px / 256) ** 2)
    return blocks * speed.block_s * BLOCK_SET_UP / speed.threads

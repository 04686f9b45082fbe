"""The rule for warping the picture."""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.bundle.stages import Undistort
from camkit.runtime.geometry.warp import Warp
from camkit.runtime.plan.decision import Decision, Subject, Work

ORDER: Final = 60
LEAST_SHIFT_PX: Final = 0.5
NOTHING_PX: Final = 1e-3
"""What rounding leaves of no distortion at all; the warp itself knows steps of 1/32 px."""
CUBIC: Final = "; by cubic interpolation, a third of the time"
"""Its cost in dB: `python -m tools.plan.undistortion` at 2a55aa66."""
_NODES: Final = 33


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Skip undistortion that would move no pixel by half a pixel."""
    stage = subject.bundle.manifest.stage(Undistort)
    if stage is None or stage.type in work.left_out:
        return work, None
    shift_px = largest_shift_px(subject)
    if subject.content is None and shift_px > NOTHING_PX:
        reason = f"quality {subject.options.quality} skips nothing"
        return work, Decision(what="undistortion", choice="yes", reason=reason)
    if shift_px >= LEAST_SHIFT_PX:
        cause = CUBIC if stage.interpolation == "cubic" else ""
        reason = f"pixels move by up to {shift_px:.1f} px{cause}"
        return work, Decision(what="undistortion", choice="yes", reason=reason)
    return replace(work, left_out=work.left_out | {stage.type}), Decision(
        what="undistortion",
        choice="skipped",
        reason=f"no pixel would move by more than {shift_px:.2f} px (limit {LEAST_SHIFT_PX} px); "
        "the shift is not part of the dB",
    )


def largest_shift_px(subject: Subject) -> float:
    """Return the largest shift of a pixel of the capture by undistortion."""
    warp = Warp(subject.bundle.distortion, subject.placement.window, to_sensor=False)
    x, y = np.meshgrid(
        np.linspace(0, subject.width_px - 1, _NODES), np.linspace(0, subject.height_px - 1, _NODES)
    )
    shifts = [
        np.hypot(*np.moveaxis(warp.positions(c, x, y) - np.stack([x, y], -1), -1, 0))
        for c in range(warp.channels)
    ]
    return float(np.max(shifts))

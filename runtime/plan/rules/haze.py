"""The rule for removing the haze of the optics."""

from typing import Final

from camkit.bundle.stages import Dehaze
from camkit.caller import option_text
from camkit.runtime.bank.cell_means import cell_count
from camkit.runtime.plan.decision import Decision, Subject, Work
from camkit.runtime.plan.ways import runs

ORDER: Final = 25


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Report that it is, everywhere: haze of one place falls on all others."""
    manifest = subject.bundle.manifest
    stage = manifest.stage(Dehaze)
    if stage is None:
        return work, None
    if not runs(manifest.stages, Dehaze, work):
        return work, Decision(
            what="haze", choice="left in", reason=option_text("method", work.method)
        )
    sides_px = subject.height_px, subject.width_px
    down, across = (cell_count(side_px, stage.shrink) for side_px in sides_px)
    return work, Decision(
        what="haze",
        choice="removed everywhere",
        reason=f"veiling glare reaches the whole picture; solved in {down * across} cells of "
        f"{stage.shrink} px",
    )

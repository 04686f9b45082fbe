"""Whether the haze of the optics is undone."""

from typing import Final

from camkit.bundle.stages import Dehaze
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
        return work, Decision(what="haze", choice="left in", reason=f"--method {work.method}")
    cells = (subject.height_px // stage.shrink) * (subject.width_px // stage.shrink)
    return work, Decision(
        what="haze",
        choice="undone everywhere",
        reason=f"light of one place falls on all others; solved in {cells} cells of "
        f"{stage.shrink} px",
    )

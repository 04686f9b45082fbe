"""The rule for the number of wavelengths of the bank."""

from typing import Final

from camkit.bundle.stages import Wiener
from camkit.runtime.plan.decision import Decision, Subject, Work
from camkit.runtime.plan.ways import runs

ORDER: Final = 40


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Keep all: they are folded into one kernel per colour once, so fewer would save nothing."""
    if not runs(subject.bundle.manifest.stages, Wiener, work):
        return work, None
    count = subject.bundle.psf.wavelengths_um.size
    return work, Decision(
        what="wavelengths",
        choice=f"all {count}",
        reason="combined into one kernel per colour; fewer would save no time",
    )

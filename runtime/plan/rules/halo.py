"""The rule for the halo of windows."""

from typing import Final

from camkit.caller import option_text
from camkit.runtime.plan.decision import Decision, Subject, Work

ORDER: Final = 50


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Keep the network's reach unless the caller chose otherwise.

    With less, pixels near a window's border would depend on where the windows lie, that is on tile
    size and memory cap; for a few percent of the network's time that promise is not given up.
    """
    if work.networks and work.mode == "exact" and (operators := subject.global_text(work.sizes())):
        reason = f"the network looks at the whole picture ({operators})"
        return work, Decision(what="halo", choice="one window", reason=reason)
    if not work.networks or subject.role is None:
        return work, None
    facts = subject.facts(work.size)
    shorter = [e for e in facts.halo_error if e.psnr_db is not None and e.psnr_db >= 80.0]
    if work.mode != "exact":
        reason = f"set by {option_text('mode', work.mode)}"
        return work, Decision(what="halo", choice=work.mode, reason=reason)
    reason = "results must not depend on tile size and memory limit"
    if shorter:
        least = min(shorter, key=lambda entry: entry.halo_px)
        fast = option_text("mode", "fast")
        reason += f"; {fast} takes {least.halo_px} px at {least.psnr_db:.0f} dB of the exact"
    return work, Decision(what="halo", choice=f"{subject.reach_px(work.size)} px", reason=reason)

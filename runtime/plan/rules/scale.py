"""The rule for the scale at which a capture is worked on."""

from typing import Final

from camkit.caller import option_text
from camkit.runtime.plan.decision import Decision, Subject, Work

ORDER: Final = 5
SCALE: Final = "scale"
"""Name of what this rule decides."""
DRAFT_COST_DB: Final = 1.3
"""Of a draft against size M, on average (docs/results/plan.md)."""


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Report that the mosaic is averaged over squares first, and what becomes of networks."""
    if subject.side_px == 1:
        return work, None
    option = option_text("quality", "draft") if subject.enlarged else option_text("scale")
    network = "no network: it was trained on pixels of full size"
    if work.networks:
        network = f"{work.strength:.0%} of what the network adds are kept"
    return work, Decision(
        what=SCALE,
        choice=f"1/{subject.side_px}" + (", enlarged" if subject.enlarged else ""),
        reason=f"set by {option}; {network}",
        cost_db=DRAFT_COST_DB if subject.enlarged else 0.0,
    )

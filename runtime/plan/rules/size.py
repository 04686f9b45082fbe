"""The rule for the size of network."""

from typing import Final

from camkit.caller import option_text
from camkit.runtime.plan.decision import Decision, Subject, Work
from camkit.runtime.plan.loss import read_loss_model

ORDER: Final = 10
SIZE: Final = "size"
"""What this rule decides."""
REFERENCE: Final = "M"
"""The size that `exact` takes and losses are measured against."""


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Report the size that quality, budgets or --size asked for, and what it costs."""
    if not work.networks:
        return work, None
    options = subject.options
    if options.size is not None:
        reason = f"set by {option_text('size')}"
    elif options.scale != "1":
        reason = f"set by {option_text('scale', options.scale)}"
    elif options.max_seconds is not None or options.max_error_db is not None:
        reason = "the best within the stated limits"
    else:
        reason = f"quality {options.quality}"
    return work, Decision(
        what=SIZE, choice=work.size, reason=reason, cost_db=size_cost_db(subject, work.size)
    )


def size_cost_db(subject: Subject, size: str) -> float:
    """Return the predicted loss of a size on this capture; 0 where nothing was calibrated."""
    model = read_loss_model(subject.bundle.manifest.plan)
    if model is None or subject.content is None or size == REFERENCE or subject.side_px > 1:
        return 0.0
    losses = model.predict(subject.content)
    extra = losses.extra.get(size)
    return 0.0 if extra is None else losses.loss_db(float(extra.sum()))

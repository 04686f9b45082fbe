"""Quality and budgets -> rules -> work and decisions.

exact      M, nothing skipped            best     the largest size, nothing skipped
adaptive   M, within adaptive.loss_db    draft    the smallest size at half scale, enlarged; of what
                                                  is no mosaic, within draft.loss_db
--scale          a smaller picture: the smallest size at 1/2, the bank alone at 1/4
--max-error-db   the cheapest of all sizes whose predicted worst loss stays below
--max-seconds    the best of a ladder from exact to the bank alone that fits
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.options import Options
from camkit.runtime.plan.binned_work import SIDES_PX, binned_work
from camkit.runtime.plan.counted import counted_work
from camkit.runtime.plan.decision import Decision, Subject, Work
from camkit.runtime.plan.estimate import estimate_seconds
from camkit.runtime.plan.loss import LossModel, read_loss_model
from camkit.runtime.plan.rule import apply_rules
from camkit.runtime.plan.rules.size import REFERENCE, SIZE, size_cost_db
from camkit.runtime.plan.speed import Speed
from camkit.runtime.plan.ways import (
    planned,
    stand_ins,
    ways_of,
    without_networks,
)
from camkit.runtime.stage_finder import module_of

LADDER: Final = (0.0, 1.0, 3.0, 10.0, 30.0)
"""Losses tried for --max-seconds, in units of that of `adaptive`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The work on a capture, and the reasons for it.

    Attributes:
        subject: What the rules looked at.
        work: The result.
        steps: (work before, decision, work after) of every rule.
        note: What the caller should be warned of; empty if nothing.
    """

    subject: Subject
    work: Work
    steps: tuple[tuple[Work, Decision, Work], ...]
    note: str = ""

    @property
    def cost_db(self) -> float:
        """Return the predicted loss against `exact`."""
        return sum(decision.cost_db for _, decision, _ in self.steps)

    def sizes(self) -> list[str]:
        """Return the sizes of the networks whose speed the savings need."""
        works = [self.work, *(w for before, _, after in self.steps for w in (before, after))]
        names = {size for work in works for size in (work.size, work.small)}
        return [s for s in self.subject.bundle.manifest.sizes if s in names | {REFERENCE}]

    def decisions(self, speed: Speed | None = None) -> list[Decision]:
        """Return the decisions; with a speed, with the seconds they save.

        What a size costs is that of the subject as it is known now: it may have been looked at
        since the plan was made.
        """
        decisions = [
            replace(decision, cost_db=size_cost_db(self.subject, decision.choice))
            if decision.what == SIZE
            else decision
            for _, decision, _ in self.steps
        ]
        if speed is None:
            return decisions
        return [
            replace(decision, saving_s=self._saving_s(number, speed))
            for number, decision in enumerate(decisions)
        ]

    def _saving_s(self, step: int, speed: Speed) -> float:
        """Return the seconds that a step saves; the size, the first, against the reference."""
        before, _, after = self.steps[step]
        is_saving = step == 0 and before is after and after.size != REFERENCE
        if is_saving and any(size == REFERENCE for _, size in speed.network_s_per_mp):
            before = replace(before, size=REFERENCE)
        if before is after:
            return 0.0
        return estimate_seconds(self.subject, before, speed) - estimate_seconds(
            self.subject, after, speed
        )


def default_size(bundle: Bundle, options: Options) -> str:
    """Return the size that a pipeline gets ready: --size, or that of the quality."""
    if options.size is not None:
        return options.size
    sizes = bundle.manifest.sizes
    if not sizes:
        return REFERENCE
    if options.quality == "best":
        return sizes[-1]
    if options.quality == "draft" or options.scale != "1":
        return sizes[0]
    return REFERENCE if REFERENCE in sizes or len(sizes) > 1 else sizes[0]


def needs_content(options: Options) -> bool:
    """Return whether the choice depends on the capture."""
    budgets = options.max_seconds is not None or options.max_error_db is not None
    return budgets or options.quality in {"adaptive", "draft"}


def make_plan(subject: Subject, speed: Callable[[], Speed]) -> Plan:
    """Decide the work on a capture.

    Args:
        subject: The capture; its content must be measured where `needs_content`.
        speed: Gives how fast the machine is; only called for --max-seconds.
    """
    options = subject.options
    model = read_loss_model(subject.bundle.manifest.plan)
    work = asked_work(subject.bundle, options, subject.side_px)
    if not work.networks or subject.side_px > 1:
        return _ruled(subject, work)
    if options.max_seconds is not None:
        return _within_seconds(subject, work, model, speed())
    if options.max_error_db is not None:
        return _within_error(subject, work, model)
    if model is None or options.quality in {"exact", "best"}:
        return _ruled(subject, work)
    spend = model.adaptive_db if options.quality == "adaptive" else model.draft_db
    if options.quality == "draft":
        spend += size_cost_db(subject, work.size)
    return _ruled(replace(subject, loss_db=spend), work)


def asked_work(bundle: Bundle, options: Options, side_px: int | None = None) -> Work:
    """Return the work that a caller asked for.

    Args:
        bundle: The camera.
        options: What was chosen.
        side_px: Of the squares that a capture is averaged over; None before any is known.

    Raises:
        ContractError: If no stage has the method, or what it leaves out cannot be.
    """
    stages = bundle.manifest.stages
    unwanted = {
        stage.type
        for stage in stages
        if (test := getattr(module_of(stage), "is_left_out", None)) and test(options)
    }
    work = Work(
        method=options.method,
        size=default_size(bundle, options),
        mode=options.mode,
        left_out=frozenset(unwanted),
    )
    stand_ins(stages, ways_of(stages, work), bundle.manifest.all_planes)
    side = SIDES_PX[options.scale] if side_px is None else side_px
    return binned_work(bundle.manifest, options, planned(stages, work), side)


def _ruled(subject: Subject, work: Work, note: str = "") -> Plan:
    steps = apply_rules(subject, work)
    last = steps[-1][2] if steps else work
    return Plan(subject=subject, work=last, steps=tuple(steps), note=note)


def _sizes(subject: Subject) -> list[str]:
    """Return the sizes to choose from, from the best on; never above the reference."""
    if subject.options.size is not None:
        return [subject.options.size]
    sizes = list(subject.bundle.manifest.sizes[::-1])
    return sizes[sizes.index(REFERENCE) :] if REFERENCE in sizes else sizes


def _within_error(subject: Subject, work: Work, model: LossModel | None) -> Plan:
    """Return the cheapest plan whose predicted loss stays below the limit."""
    limit = subject.options.max_error_db
    if limit is None or model is None:
        return _ruled(subject, work, "the bundle carries no calibrated plan: nothing is skipped")
    spend = model.budget_db(limit)
    plans = [
        _ruled(replace(subject, loss_db=spend), replace(work, size=size))
        for size in _sizes(subject)
        if size == _sizes(subject)[0] or size_cost_db(subject, size) <= spend
    ]
    return min(plans, key=lambda plan: counted_work(plan.subject, plan.work))


def _within_seconds(subject: Subject, work: Work, model: LossModel | None, speed: Speed) -> Plan:
    """Return the first plan of the ladder that fits the time."""
    limit = subject.options.max_seconds
    if limit is None:
        raise ContractError("a plan within a time needs max_seconds")
    unit = 0.0 if model is None else model.adaptive_db
    most_db = subject.options.max_error_db
    plans = []
    for size in _sizes(subject):
        for factor in LADDER if model is not None else LADDER[:1]:
            spend = 0.0 if factor == 0 else size_cost_db(subject, size) + factor * unit
            plans.append(_ruled(replace(subject, loss_db=spend), replace(work, size=size)))

    def seconds(plan: Plan) -> float:
        return estimate_seconds(plan.subject, plan.work, speed)

    # The bank alone is the last resort: what it costs is not bounded by any prediction.
    last = without_networks(subject.bundle.manifest, work)
    ordered = sorted(plans, key=lambda plan: plan.cost_db)
    ordered += [] if last is None else [_ruled(subject, last)]
    cheapest = min(plans, key=seconds) if last is None else ordered[-1]
    best = next((plan for plan in ordered if seconds(plan) <= limit), cheapest)
    note = ""
    if seconds(best) > limit:
        least = "the least work" if last is None else "the filter bank alone"
        note = f"even {least} is expected to take more than {limit:g} s"
    elif most_db is not None and model is not None and best.cost_db > model.budget_db(most_db):
        note = f"no plan keeps within both {limit:g} s and {most_db:g} dB"
    return replace(best, note=note)

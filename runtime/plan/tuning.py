"""The tuning of a stage's methods, as far as bundle and code state it; nothing is guessed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from camkit.bundle.entry import Entry
from camkit.bundle.stages import Stage
from camkit.runtime.stage_finder import module_of

Value = float | int | str | None
NOT_RECORDED = "not recorded"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """The tuning of a method.

    Attributes:
        values: Its parameters by name, units behind; empty if it has none.
        source: Where they come from.
        captures: What they were tuned on, in the words of whoever recorded it.
        follows: What they follow from capture to capture, such as its noise; empty for nothing.
    """

    values: Mapping[str, Value] = field(default_factory=dict)
    source: str
    captures: str = NOT_RECORDED
    follows: str = ""


def stage_tuning(stages: Sequence[Stage], method: str) -> Tuning | None:
    """Return the tuning of a method by the last stage that has it; None where no stage has it.

    A stage whose module defines `tuning(entry, method)` says it itself; of any other the numbers
    that the bundle states for it are told.
    """
    restoring = [stage for stage in stages if method in module_of(stage).METHODS]
    if not restoring:
        return None
    stage = restoring[-1]
    tuning_of = getattr(module_of(stage), "tuning", None)
    if tuning_of is not None:
        tuning: Tuning = tuning_of(stage, method)
        return tuning
    values = stated_numbers(stage)
    if not values:
        return Tuning(source=f"stage {stage.type} states no parameter; its constants are camkit's")
    return Tuning(values=values, source=f"stage {stage.type} of the bundle")


def stated_numbers(entry: Entry) -> dict[str, Value]:
    """Return the single numbers that an entry of a manifest states, by name."""
    fields = entry.model_dump(mode="json")
    return {name: value for name, value in fields.items() if isinstance(value, int | float)}

"""Rules found in `rules/`: one module each, with ORDER and `decide`; a new file is a new rule."""

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module

from camkit.errors import ContractError
from camkit.runtime.plan import rules
from camkit.runtime.plan.decision import Decision, Subject, Work

Decide = Callable[[Subject, Work], tuple[Work, Decision | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One rule.

    Attributes:
        name: Of its module.
        order: Rules run by increasing order.
        decide: Gives the work as the rule wants it, and what it decided; None where the rule
            does not apply.
    """

    name: str
    order: int
    decide: Decide


@cache
def find_rules() -> tuple[Rule, ...]:
    """Return the rules in their order.

    Raises:
        ContractError: If a module of `rules/` has no ORDER or no `decide`.
    """
    loaded_rules = []
    for module in pkgutil.iter_modules(rules.__path__):
        loaded = import_module(f"{rules.__name__}.{module.name}")
        order, decide = getattr(loaded, "ORDER", None), getattr(loaded, "decide", None)
        if not isinstance(order, int) or not callable(decide):
            raise ContractError(f"the rule {module.name} needs an int ORDER and a function decide")
        loaded_rules.append(Rule(name=module.name, order=order, decide=decide))
    return tuple(sorted(loaded_rules, key=lambda rule: (rule.order, rule.name)))


def apply_rules(subject: Subject, work: Work) -> list[tuple[Work, Decision, Work]]:
    """Apply all rules; return (work before, decision, work after) of those that apply."""
    steps = []
    for rule in find_rules():
        next_work, decision = rule.decide(subject, work)
        if decision is not None:
            steps.append((work, decision, next_work))
        work = next_work
    return steps

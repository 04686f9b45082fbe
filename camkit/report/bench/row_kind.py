"""The type of a kind of rows, and all kinds that are registered."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from camkit.errors import ContractError
from camkit.report.bench.case import Axes, Case, Entrant, Ground, Skip
from camkit.report.bench.discovery import discover

MakeCases = Callable[[Entrant, Axes, Ground], tuple[list[Case], list[Skip]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RowKind:
    """A kind of rows.

    Attributes:
        name: Stands in `kind` of its rows.
        methods: Names that `--methods` takes for it.
        cases: Gives the cases of a bundle, and what was asked for but cannot be measured; called
            only if one of its methods is wanted.
    """

    name: str
    methods: tuple[str, ...]
    cases: MakeCases


def row_kinds() -> tuple[RowKind, ...]:
    """Give all kinds that are registered."""
    return discover("camkit.report.bench.kinds", "KIND", RowKind)


def make_cases(
    entrants: Sequence[Entrant], axes: Axes, ground: Ground
) -> tuple[list[Case], list[Skip]]:
    """Give the cases of all bundles, and what cannot be measured.

    Raises:
        ContractError: If a method is of no kind.
    """
    registered = row_kinds()
    known = [method for kind in registered for method in kind.methods]
    if unknown := [m for m in axes.methods or () if m not in known]:
        raise ContractError(f"methods are {', '.join(known)}; got {', '.join(unknown)}")
    cases: list[Case] = []
    skips: list[Skip] = []
    for entrant in entrants:
        for kind in registered:
            if axes.methods is None or set(axes.methods) & set(kind.methods):
                made, left = kind.cases(entrant, axes, ground)
                cases += made
                skips += left
    return cases, skips

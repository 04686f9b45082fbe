"""What makes the rows of one sort, and all makers that are registered."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from camkit.errors import ContractError
from camkit.report.bench.discovery import discover
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial

MakeTrials = Callable[[Entrant, Axes, Ground], tuple[list[Trial], list[Skip]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RowMaker:
    """Makes the rows of one sort, as trials that are not measured yet.

    Attributes:
        name: Stands under `kind` in its rows.
        methods: Names that `--methods` takes for it.
        trials: Gives the trials of a bundle, and what was asked for but cannot be measured; called
            only if one of its methods is wanted.
    """

    name: str
    methods: tuple[str, ...]
    trials: MakeTrials


def row_makers() -> tuple[RowMaker, ...]:
    """Give all makers that are registered."""
    return discover("camkit.report.bench.rows", "ROWS", RowMaker)


def make_trials(
    entrants: Sequence[Entrant], axes: Axes, ground: Ground
) -> tuple[list[Trial], list[Skip]]:
    """Give the trials of all bundles, and what cannot be measured.

    Raises:
        ContractError: If a method has no maker.
    """
    registered = row_makers()
    known = [method for maker in registered for method in maker.methods]
    if unknown := [m for m in axes.methods or () if m not in known]:
        raise ContractError(f"methods are {', '.join(known)}; got {', '.join(unknown)}")
    trials: list[Trial] = []
    skips: list[Skip] = []
    for entrant in entrants:
        for maker in registered:
            if axes.methods is None or set(axes.methods) & set(maker.methods):
                made, left = maker.trials(entrant, axes, ground)
                trials += made
                skips += left
    return trials, skips

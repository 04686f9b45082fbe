"""What makes the rows of one sort."""

from collections.abc import Callable
from dataclasses import dataclass

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

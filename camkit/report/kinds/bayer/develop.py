"""No reconstruction: what `camkit process --bundle none` does, the floor of time and quality."""

from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.runtime.plan.decision import DEVELOP


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Return one trial for the captures of every camera; a DNG needs no bundle to be developed."""
    if entrant.is_reference:
        return [], []
    threads = ground.base_threads(axes)
    trial = Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=None,
        maker=ROWS.name,
        method=DEVELOP,
        threads=threads,
        base_threads=threads,
    )
    return [trial], []


ROWS = RowMaker(name="develop", methods=(DEVELOP,), trials=make_trials)

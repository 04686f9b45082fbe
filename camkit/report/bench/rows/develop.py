"""No restoration: the other stages of a bundle alone, the floor of time and quality."""

from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.runtime.plan.decision import DEVELOP
from camkit.runtime.plan.ways import offered_methods


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Give one trial for the captures of every camera that can do without restoration."""
    if entrant.is_reference:
        return [], []
    manifest = entrant.bundle.manifest
    if DEVELOP not in offered_methods(manifest.stages, manifest.all_planes):
        reason = "nothing stands for what its restoration gives"
        asked = axes.methods is not None
        return [], [Skip(f"{entrant.label} {DEVELOP}", reason)] if asked else []
    threads = ground.base_threads(axes)
    trial = Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        maker=ROWS.name,
        method=DEVELOP,
        threads=threads,
        base_threads=threads,
    )
    return [trial], []


ROWS = RowMaker(name="develop", methods=(DEVELOP,), trials=make_trials)

"""What a bundle restores by its optics alone, where one of its stages knows that as a method."""

from typing import Final

from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.runtime.plan.ways import offered_methods

METHOD: Final = "physics"
"""`camkit process --method physics`: a solve without the network behind it."""


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Give one trial, on the first number of threads asked for."""
    if entrant.is_reference:
        return [], []
    manifest = entrant.bundle.manifest
    if METHOD not in offered_methods(manifest.stages, manifest.all_planes):
        reason = "no stage of the bundle has this method"
        asked = axes.methods is not None
        return [], [Skip(f"{entrant.label} {METHOD}", reason)] if asked else []
    threads = ground.base_threads(axes)
    trial = Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        maker=ROWS.name,
        method=METHOD,
        threads=threads,
        base_threads=threads,
    )
    return [trial], []


ROWS = RowMaker(name="physics", methods=(METHOD,), trials=make_trials)

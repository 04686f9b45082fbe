"""Rows of a single method of a bundle, where its stages offer that method."""

from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.runtime.plan.ways import offered_methods


def method_rows(name: str, method: str, *, lacking: str) -> RowMaker:
    """Return the maker of one row per bundle, on the first number of threads asked for.

    Args:
        name: Of the maker.
        method: As `camkit process --method` takes it.
        lacking: Why a bundle that does not offer it has no row; said where the method was asked.
    """

    def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
        if entrant.is_reference:
            return [], []
        manifest = entrant.bundle.manifest
        if method not in offered_methods(manifest.stages, manifest.all_planes):
            asked = axes.methods is not None
            return [], [Skip(f"{entrant.label} {method}", lacking)] if asked else []
        threads = ground.base_threads(axes)
        trial = Trial(
            camera=entrant.camera,
            bundle=entrant.label,
            path=entrant.bundle.path,
            maker=name,
            method=method,
            threads=threads,
            base_threads=threads,
        )
        return [trial], []

    return RowMaker(name=name, methods=(method,), trials=make_trials)

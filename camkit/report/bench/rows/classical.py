"""The methods of a bundle without networks, such as the classical ones on its blocks and PSFs."""

from typing import Final

from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.rows import physics
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.plan.ways import offered_methods, planned
from camkit.runtime.stage_finder import all_methods, stage_module

METHODS: Final = tuple(
    m for m in all_methods() if m not in (*stage_module("network").METHODS, physics.METHOD)
)


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Return every method once, on the first number of threads asked for."""
    if entrant.is_reference:
        return [], []
    manifest = entrant.bundle.manifest
    offered = [
        method
        for method in offered_methods(manifest.stages, manifest.all_planes)
        if method not in (DEVELOP, physics.METHOD)
        and not planned(manifest.stages, Work(method=method)).networks
    ]
    threads = ground.base_threads(axes)
    trials = [
        Trial(
            camera=entrant.camera,
            bundle=entrant.label,
            path=entrant.bundle.path,
            maker=ROWS.name,
            method=method,
            threads=threads,
            base_threads=threads,
        )
        for method in offered
        if axes.methods is None or method in axes.methods
    ]
    lacking = [m for m in axes.methods or () if m in METHODS and m not in offered]
    reason = "no stage of the bundle has this method"
    return trials, [Skip(f"{entrant.label} {method}", reason) for method in lacking]


ROWS = RowMaker(name="classical", methods=METHODS, trials=make_trials)

"""Classical methods on the blocks and PSFs of a bundle, tuned and padded by the runtime."""

from camkit.bundle.manifest import Wiener
from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial

METHODS = ("wiener", "rl", "admm-tv")


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Give every method once, on the first number of threads asked for."""
    if entrant.is_reference:
        return [], []
    wanted = [m for m in METHODS if axes.methods is None or m in axes.methods]
    if entrant.bundle.manifest.stage(Wiener) is None:
        return [], [Skip(f"{entrant.label} {m}", "the bundle has no Wiener bank") for m in wanted]
    threads = ground.base_threads(axes)
    return [
        Trial(
            camera=entrant.camera,
            bundle=entrant.label,
            path=entrant.bundle.path,
            maker=ROWS.name,
            method=method,
            threads=threads,
            base_threads=threads,
        )
        for method in wanted
    ], []


ROWS = RowMaker(name="classical", methods=METHODS, trials=make_trials)

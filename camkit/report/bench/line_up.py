"""Who takes part and by what it is judged: common makers and metrics, and those of each kind."""

from collections.abc import Sequence
from dataclasses import replace

from camkit.bundle.manifest import Manifest
from camkit.errors import ContractError, UnsupportedError
from camkit.kinds import find_kind
from camkit.report.bench.common_rows import COMMON
from camkit.report.bench.metric import Metric, registered_metrics
from camkit.report.bench.part import BenchPart, RowMaker
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.report.kind_finder import find_part
from camkit.runtime.plan.ways import offered_methods


def makers_of(manifest: Manifest) -> tuple[RowMaker, ...]:
    """Return the row makers of a camera, by name; one of its kind goes before a common one."""
    own = find_part(manifest.kind, "bench", BenchPart).rows
    known = {maker.name: maker for maker in (*COMMON, *own)}
    return tuple(known[name] for name in sorted(known))


def metrics_of(manifest: Manifest) -> tuple[Metric, ...]:
    """Return the metrics that a kind of camera names, for the products that the bundle has.

    Raises:
        UnsupportedError: If it names one that is not there.
    """
    own = find_part(manifest.kind, "bench", BenchPart).metrics
    known = {metric.name: metric for metric in (*registered_metrics(), *own)}
    named = find_kind(manifest.kind).metrics
    if absent := [name for name in named if name not in known]:
        raise UnsupportedError(
            f"cameras of the kind {manifest.kind!r} are judged by {', '.join(absent)}; reports "
            f"know {', '.join(known)}"
        )
    return tuple(known[name] for name in named if known[name].product in manifest.products)


def make_trials(
    entrants: Sequence[Entrant], axes: Axes, ground: Ground
) -> tuple[list[Trial], list[Skip]]:
    """Return the trials of all bundles, and what cannot be measured.

    Raises:
        ContractError: If a method has no maker.
    """
    makers = {entrant.label: makers_of(entrant.bundle.manifest) for entrant in entrants}
    known = dict.fromkeys(method for own in makers.values() for m in own for method in m.methods)
    if unknown := [m for m in axes.methods or () if m not in known]:
        raise ContractError(f"methods are {', '.join(known)}; got {', '.join(unknown)}")
    trials: list[Trial] = []
    skips: list[Skip] = []
    for entrant in entrants:
        own = _axes_of(entrant, axes)
        for maker in makers[entrant.label]:
            if own.methods is None or set(own.methods) & set(maker.methods):
                made, left = maker.trials(entrant, own, ground)
                trials += made
                skips += left
    return trials, skips


def _axes_of(entrant: Entrant, axes: Axes) -> Axes:
    """Return the axes of one bundle, its best methods named where that many are wanted."""
    if axes.methods is not None or axes.best is None:
        return axes
    manifest = entrant.bundle.manifest
    offered = offered_methods(manifest.stages, manifest.all_planes)
    return replace(axes, methods=offered[: axes.best])

"""Makers and metrics of a camera: common ones and those of its kind; and all its trials."""

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
    kind_rows = find_part(manifest.kind, "bench", BenchPart).rows
    by_name = {maker.name: maker for maker in (*COMMON, *kind_rows)}
    return tuple(by_name[name] for name in sorted(by_name))


def metrics_of(manifest: Manifest) -> tuple[Metric, ...]:
    """Return the metrics that a kind of camera names, for the products that the bundle has.

    Raises:
        UnsupportedError: If it names one that is not there.
    """
    kind_metrics = find_part(manifest.kind, "bench", BenchPart).metrics
    by_name = {metric.name: metric for metric in (*registered_metrics(), *kind_metrics)}
    names = find_kind(manifest.kind).metrics
    if absent := [name for name in names if name not in by_name]:
        raise UnsupportedError(
            f"cameras of the kind {manifest.kind!r} are judged by {', '.join(absent)}; reports "
            f"know {', '.join(by_name)}"
        )
    return tuple(by_name[name] for name in names if by_name[name].product in manifest.products)


def make_trials(
    entrants: Sequence[Entrant], axes: Axes, ground: Ground
) -> tuple[list[Trial], list[Skip]]:
    """Return the trials of all bundles, and what cannot be measured.

    Raises:
        ContractError: If a method has no maker.
    """
    makers = {entrant.label: makers_of(entrant.bundle.manifest) for entrant in entrants}
    methods = dict.fromkeys(
        method for rows in makers.values() for m in rows for method in m.methods
    )
    if unknown := [m for m in axes.methods or () if m not in methods]:
        raise ContractError(f"methods are {', '.join(methods)}; got {', '.join(unknown)}")
    trials: list[Trial] = []
    skips: list[Skip] = []
    for entrant in entrants:
        entrant_axes = _axes_of(entrant, axes)
        for maker in makers[entrant.label]:
            if entrant_axes.methods is None or set(entrant_axes.methods) & set(maker.methods):
                new_trials, new_skips = maker.trials(entrant, entrant_axes, ground)
                trials += new_trials
                skips += new_skips
    return trials, skips


def _axes_of(entrant: Entrant, axes: Axes) -> Axes:
    """Return the axes of one bundle, its best methods named where that many are wanted."""
    if axes.methods is not None or axes.best is None:
        return axes
    manifest = entrant.bundle.manifest
    methods = offered_methods(manifest.stages, manifest.all_planes)
    return replace(axes, methods=methods[: axes.best])

"""All that is known about a trial as one flat record; unknown values are None."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from camkit.report.bench.accuracy import (
    INPUT,
    SUPPLIED,
    Key,
    Scores,
    mean_and_spread,
    mean_gain,
    score_key,
    standard_error_of_gain,
)
from camkit.report.bench.edge import Edges
from camkit.report.bench.metric import Metric
from camkit.report.bench.split import split_columns
from camkit.report.bench.timed.process_run import Run
from camkit.report.bench.timed.timing import Spread, is_noisy, paired_ratio, quantile, spread_of
from camkit.report.bench.trial import Trial

Row = dict[str, Any]
MP_OF_REFERENCE: Final = 24.0
NETWORK: Final = "network"
"""The stage of networks; where there are several, their keys go on with the role."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Facts that a row takes from elsewhere.

    Attributes:
        size_px: (width, height) of the capture that is timed.
        mac_per_px: Of the trial's networks.
        gemm_gmac_per_s: Peak of the machine at the trial's threads.
        scores: Of all methods of the trial's camera.
        metrics: Of that camera.
        edges: What an edge says of that camera.
        base: Runs of the trial that others are compared with.
        base_label: Its label.
        base_key: Key of its scores.
    """

    size_px: tuple[int, int]
    mac_per_px: float | None
    gemm_gmac_per_s: float | None
    scores: dict[Key, Scores]
    metrics: Sequence[Metric]
    base: Sequence[Run]
    base_label: str
    base_key: Key
    edges: Edges = field(default_factory=Edges)


def make_row(trial: Trial, runs: Sequence[Run], facts: Facts) -> Row:
    """Join what is known about a trial.

    Args:
        trial: The trial.
        runs: Its processes, in the order of the rounds.
        facts: What is known from elsewhere.
    """
    width, height = facts.size_px
    row: Row = {
        "bundle": trial.bundle,
        "camera": trial.camera,
        "label": trial.label,
        "kind": trial.maker,
        "variant": trial.is_variant,
        "method": trial.method,
        "size": trial.size,
        "mode": trial.mode,
        "dtype": trial.dtype,
        "provider": trial.provider,
        "threads": trial.threads,
        "tile_px": trial.tile_px,
        "width": width,
        "height": height,
        **_seconds(runs, facts, width * height / 1e6),
        **_network_share(trial, runs, facts),
        **_accuracy(trial, facts),
        **facts.edges.columns(score_key(trial)),
    }
    failed = next((run.error for run in runs if run.error is not None), None)
    scores = facts.scores.get(score_key(trial))
    row["error"] = failed or (None if scores is None else scores.error)
    return row


def _seconds(runs: Sequence[Run], facts: Facts, megapixels: float) -> Row:
    fresh = _numbers(run.seconds for run in runs)
    spread = spread_of(fresh)
    steady = spread_of([s for run in runs for s in run.steady_s])
    load = _median(run.load_of_others for run in runs)
    median = None if spread is None else spread.median
    return {
        "n": len(fresh),
        **_spread_columns("seconds", spread),
        "seconds_ratio": paired_ratio(fresh, _numbers(run.seconds for run in facts.base)),
        "ratio_to": facts.base_label,
        "cpu_seconds_median": _median(run.cpu_s for run in runs),
        "steady_n": 0 if steady is None else steady.n,
        **_spread_columns("steady_seconds", steady),
        "steady_cpu_seconds_median": _median(s for run in runs for s in run.steady_cpu_s),
        "stages": _stage_medians(runs),
        "mp_per_s": None if median is None else megapixels / median,
        "s_per_24mp": None if median is None else MP_OF_REFERENCE * median / megapixels,
        "peak_rss_mb": _median(run.peak_rss_mb for run in runs),
        "load_of_others": load,
        "noisy": is_noisy(spread, load),
    }


def _spread_columns(name: str, spread: Spread | None) -> Row:
    parts = ("first", "least", "median", "p90", "p99")
    names = {"least": "min"}
    return {
        f"{name}_{names.get(part, part)}": None if spread is None else getattr(spread, part)
        for part in parts
    }


def _network_share(trial: Trial, runs: Sequence[Run], facts: Facts) -> Row:
    """Return the networks' useful multiply-adds per second over the machine's peak (CPU only)."""
    stages = _stage_medians(runs).items()
    seconds = sum(s for stage, s in stages if stage.split()[0] == NETWORK)
    share = None
    is_computable = facts.mac_per_px is not None and facts.gemm_gmac_per_s is not None
    if is_computable and seconds and trial.provider == "cpu":
        width, height = facts.size_px
        assert facts.mac_per_px is not None
        assert facts.gemm_gmac_per_s is not None
        share = facts.mac_per_px * width * height / 1e9 / seconds / facts.gemm_gmac_per_s
        if share > 1:  # others kept the matrix product from its peak: the share is unknown
            share = None
    return {"mac_per_px": facts.mac_per_px, "share_of_gemm_peak": share}


def _accuracy(trial: Trial, facts: Facts) -> Row:
    scores = facts.scores.get(score_key(trial))
    of_input = facts.scores.get(SUPPLIED, facts.scores.get(INPUT))
    of_base = facts.scores.get(facts.base_key)
    lenses = set() if scores is None else scores.psf
    row: Row = {
        "psf": "+".join(sorted(lenses)) or None,
        "images": 0 if scores is None else len(scores.by_picture),
        "captures": 0,
    }
    for metric in facts.metrics:
        for column in metric.columns:
            name = column.name
            mean, spread = _means(scores, name)
            row[name] = mean
            if column.spread is not None:
                row[column.spread] = spread
            if column.of_input is not None:
                row[column.of_input] = _means(of_input, name)[0]
            if column.spread is not None:
                row[f"gain_se_{name}"] = _gain(scores, of_input, name)[1]
                row[f"over_base_{name}"], row[f"over_base_se_{name}"] = _gain(scores, of_base, name)
            if scores is not None:
                count = sum(len(v.get(name, ())) for v in scores.by_picture.values())
                row["captures"] = max(row["captures"], count)
        row |= {} if metric.notes is None else metric.notes()
    row |= split_columns(scores, of_input, facts.metrics)
    return row | _each_picture(facts.metrics, scores, of_input)


def _each_picture(metrics: Sequence[Metric], scores: Scores | None, of_input: Scores | None) -> Row:
    """Return the numbers of every picture, of the metrics that want it; nothing where none does."""
    columns = [column for m in metrics if m.each_picture for column in m.columns]
    if not columns:
        return {}
    by_picture: dict[str, Row] = {} if scores is None else {name: {} for name in scores.by_picture}
    for column in columns:
        sources = ((column.name, scores), (column.of_input, of_input))
        for name, source in sources:
            if name is not None and source is not None:
                for picture, value in source.picture_means(column.name).items():
                    by_picture.setdefault(picture, {})[name] = value
    return {"pictures": by_picture}


def _gain(
    scores: Scores | None, other: Scores | None, column: str
) -> tuple[float | None, float | None]:
    """Return mean and standard error over pictures of the gain over another method."""
    if scores is None or other is None or scores is other:
        return None, None
    return mean_gain(scores, other, column), standard_error_of_gain(scores, other, column)


def _means(scores: Scores | None, column: str) -> tuple[float | None, float | None]:
    return mean_and_spread([] if scores is None else scores.picture_means(column).values())


def _stage_medians(runs: Sequence[Run]) -> dict[str, float]:
    names = dict.fromkeys(name for run in runs for name in run.stages)
    medians = {name: _median(run.stages.get(name) for run in runs) for name in names}
    return {name: value for name, value in medians.items() if value is not None}


def _numbers(values: Any) -> list[float]:
    return [value for value in values if value is not None]


def _median(values: Any) -> float | None:
    numbers = _numbers(values)
    return quantile(numbers, 0.5) if numbers else None

"""Every method on every known capture: scores over pictures, beside those of the input."""

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.bundle.reader import Bundle, open_bundle
from camkit.errors import CamkitError
from camkit.report.bench.known_captures import KnownCapture
from camkit.report.bench.metric import Metric
from camkit.report.bench.trial import Trial
from camkit.report.sensor_geometry import in_sensor_geometry
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.decision import DEVELOP

Key = tuple[object, ...]
INPUT: Key = ("input",)
"""Key of the capture that was only developed."""
SUPPLIED: Key = ("brought",)
"""Key of the picture that a capture brings as its input, such as that of an ordinary lens."""
BROUGHT_NAME: Final = "input"
"""Its name among the extras of a capture."""
OnResult = Callable[[Key, KnownCapture, FloatArray], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptureScores:
    """One capture by one method.

    Attributes:
        picture: Name of the picture.
        iso: Sensitivity.
        field_share: Where the capture lies, see `KnownCapture`.
        field_mm: Likewise.
        values: Column -> value.
    """

    picture: str
    iso: float
    field_share: float | None
    field_mm: float | None
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """Scores of one method.

    Attributes:
        by_picture: Picture -> column -> values, one per capture.
        captures: The same capture by capture, with what distinguishes them.
        psf: Lenses of the captures.
        error: Why there is none.
    """

    by_picture: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    captures: list[CaptureScores] = field(default_factory=list)
    psf: set[str] = field(default_factory=set)
    error: str | None = None

    def picture_means(self, column: str) -> dict[str, float]:
        """Return the mean over the captures of each picture."""
        return {p: statistics.fmean(v[column]) for p, v in self.by_picture.items() if column in v}


class Restorers:
    """Pipelines by what decides their pixels, made when first needed."""

    def __init__(self, bundle: Bundle, threads: int) -> None:
        self._bundle = bundle
        self._threads = threads
        self._pipelines: dict[tuple[Key, bool], Pipeline] = {}

    def restore(
        self, trial: Trial | None, known_capture: KnownCapture, products: Iterable[str] = (IMAGE,)
    ) -> dict[str, FloatArray]:
        """Return products (c, h, w) in the geometry of the truth; pictures in linear Rec.709.

        Args:
            trial: The method; None, or one without a bundle, restores nothing.
            known_capture: The capture.
            products: Those wanted.

        Raises:
            CamkitError: If the method cannot do it.
        """
        place = INPUT if trial is None else score_key(trial), known_capture.undistort
        if place not in self._pipelines:
            self._pipelines[place] = self._make(trial, undistort=known_capture.undistort)
        pipeline = self._pipelines[place]
        capture = pipeline.capture_of(
            known_capture.capture,
            iso=known_capture.iso,
            white_balance=known_capture.white_balance,
            origin_px=known_capture.origin_px,
        )
        work = pipeline.start(capture)
        return {product: work.fill(product=product) for product in products}

    def _make(self, trial: Trial | None, *, undistort: bool) -> Pipeline:
        options: dict[str, Any] = {"method": DEVELOP}
        bundle = self._bundle
        if trial is not None and score_key(trial) != INPUT:
            assert trial.path is not None
            bundle = open_bundle(trial.path)
            options = trial.options() | {"tile_px": None}
        geometry = {} if undistort else in_sensor_geometry(bundle.manifest)
        return Pipeline(bundle, Options(**options | geometry | {"threads": self._threads}))


def score_key(trial: Trial) -> Key:
    """Return under which key a trial has its scores: rows that restore nothing are the input."""
    return INPUT if trial.method == DEVELOP else trial.accuracy_key


def measure_accuracy(
    trials: Iterable[Trial],
    captures: Iterable[KnownCapture],
    restorers: Restorers,
    metrics: Sequence[Metric],
    on_result: OnResult | None = None,
    constants: Mapping[str, Any] | None = None,
) -> dict[Key, Scores]:
    """Restore every capture by every method that differs in its pixels.

    Args:
        trials: Of one camera.
        captures: With a known truth; each is made once and not kept.
        restorers: Of that camera.
        metrics: What to measure.
        on_result: Called with every picture, that of `INPUT` first, if the camera has one.
        constants: What metrics may take that is the same for all captures.

    Returns:
        Scores by `score_key`; under `SUPPLIED` those of what captures bring as their input.
    """
    methods: dict[Key, Trial | None] = {INPUT: None}
    methods |= {score_key(t): t for t in trials if score_key(t) != INPUT}
    scores = {key: Scores() for key in methods}
    products = dict.fromkeys(metric.product for metric in metrics)
    for known_capture in captures:
        extras = {**(constants or {}), **known_capture.extras}
        if BROUGHT_NAME in extras:
            supplied = {IMAGE: extras[BROUGHT_NAME]}
            _add(scores.setdefault(SUPPLIED, Scores()), known_capture, supplied, metrics, extras)
        for key, trial in methods.items():
            if scores[key].error is not None:
                continue
            try:
                restored = restorers.restore(trial, known_capture, products)
                _add(scores[key], known_capture, restored, metrics, extras)
            except CamkitError as error:
                scores[key] = Scores(error=str(error))
                continue
            if on_result is not None and IMAGE in restored:
                on_result(key, known_capture, restored[IMAGE])
    return scores


def _add(
    scores: Scores,
    known_capture: KnownCapture,
    restored: Mapping[str, FloatArray],
    metrics: Sequence[Metric],
    extras: Mapping[str, Any],
) -> None:
    scores.psf.add(known_capture.psf)
    values = scores.by_picture.setdefault(known_capture.picture, {})
    of_capture: dict[str, float] = {}
    for metric in metrics:
        there = metric.product in known_capture.truths and metric.product in restored
        if not there or not all(name in extras for name in metric.needs):
            continue
        arguments = {n: extras[n] for n in (*metric.needs, *metric.takes) if n in extras}
        by_column = metric.measure(
            restored[metric.product], known_capture.truths[metric.product], **arguments
        )
        of_capture |= by_column
        for name, value in by_column.items():
            values.setdefault(name, []).append(value)
    scores.captures.append(
        CaptureScores(
            picture=known_capture.picture,
            iso=known_capture.iso,
            field_share=known_capture.field_share,
            field_mm=known_capture.field_mm,
            values=of_capture,
        )
    )


def mean_and_spread(values: Iterable[float]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation (n - 1); None for what the count does not allow."""
    sample = list(values)
    mean = statistics.fmean(sample) if sample else None
    return mean, statistics.stdev(sample) if len(sample) > 1 else None


def mean_gain(scores: Scores, other: Scores, column: str) -> float | None:
    """Return the mean over pictures of the gain over another method; None without pictures."""
    gains = _gains(scores, other, column)
    return statistics.fmean(gains) if gains else None


def standard_error_of_gain(scores: Scores, other: Scores, column: str) -> float | None:
    """Return the standard error over pictures of the gain over another; None for fewer than two.

    The gain is taken picture by picture, so that the contents of the pictures, which move all
    methods alike, cancel.
    """
    gains = _gains(scores, other, column)
    return statistics.stdev(gains) / math.sqrt(len(gains)) if len(gains) > 1 else None


def _gains(scores: Scores, other: Scores, column: str) -> list[float]:
    base = other.picture_means(column)
    return [v - base[p] for p, v in scores.picture_means(column).items() if p in base]

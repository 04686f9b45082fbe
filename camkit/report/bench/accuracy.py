"""Every method on every known capture: scores over pictures, beside those of the input."""

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from camkit.bundle.manifest import Network, Wiener
from camkit.bundle.reader import Bundle, open_bundle
from camkit.contracts import FloatArray
from camkit.errors import CamkitError
from camkit.report.bench.known_captures import KnownCapture
from camkit.report.bench.metric import Metric
from camkit.report.bench.trial import Trial
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline

Key = tuple[object, ...]
INPUT: Key = ("input",)
"""Key of the capture that was only developed."""
OnResult = Callable[[Key, KnownCapture, FloatArray], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """Scores of one method.

    Attributes:
        by_picture: Picture -> column -> values, one per capture.
        psf: Lenses of the captures.
        error: Why there is none.
    """

    by_picture: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    psf: set[str] = field(default_factory=set)
    error: str | None = None

    def picture_means(self, column: str) -> dict[str, float]:
        """Give the mean over the captures of each picture."""
        return {p: statistics.fmean(v[column]) for p, v in self.by_picture.items() if column in v}


class Restorers:
    """Pipelines by what decides their pixels, made when first needed."""

    def __init__(self, bundle: Bundle, threads: int) -> None:
        self._bundle = bundle
        self._threads = threads
        self._made: dict[tuple[Key, bool], Pipeline] = {}

    def restore(self, trial: Trial | None, known: KnownCapture) -> FloatArray:
        """Give linear Rec.709, (3, h, w), in the geometry of the capture's truth.

        Args:
            trial: The method; None or a trial without a bundle develops only.
            known: The capture.

        Raises:
            CamkitError: If the method cannot do it.
        """
        key = INPUT if trial is None or trial.path is None else trial.accuracy_key
        place = key, known.undistort
        if place not in self._made:
            self._made[place] = self._make(trial, undistort=known.undistort)
        return self._made[place].process_array(
            known.capture,
            iso=known.iso,
            white_balance=known.white_balance,
            origin_px=known.origin_px,
        )

    def _make(self, trial: Trial | None, *, undistort: bool) -> Pipeline:
        if trial is None or trial.path is None:
            plain = Options(method="wiener", undistort=undistort, threads=self._threads)
            return Pipeline(without_restoration(self._bundle), plain)
        chosen: dict[str, Any] = trial.options() | {"threads": self._threads, "tile_px": None}
        return Pipeline(open_bundle(trial.path), Options(**chosen, undistort=undistort))


def without_restoration(bundle: Bundle) -> Bundle:
    """Give the bundle without its Wiener bank and networks: all else is done alike."""
    stages = tuple(s for s in bundle.manifest.stages if not isinstance(s, Wiener | Network))
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def measure_accuracy(
    trials: Iterable[Trial],
    captures: Iterable[KnownCapture],
    restorers: Restorers,
    metrics: Sequence[Metric],
    on_result: OnResult | None = None,
) -> dict[Key, Scores]:
    """Restore every capture by every method that differs in its pixels.

    Args:
        trials: Of one camera.
        captures: With a known truth; each is made once and not kept.
        restorers: Of that camera.
        metrics: What to measure.
        on_result: Called with every result, `INPUT` first.

    Returns:
        Scores by `Trial.accuracy_key`, and those of `INPUT`.
    """
    methods: dict[Key, Trial | None] = {INPUT: None}
    methods |= {t.accuracy_key: t for t in trials if t.path is not None}
    found = {key: Scores() for key in methods}
    for known in captures:
        for key, trial in methods.items():
            if found[key].error is not None:
                continue
            try:
                restored = restorers.restore(trial, known)
            except CamkitError as error:
                found[key] = Scores(error=str(error))
                continue
            _add(found[key], known, restored, metrics)
            if on_result is not None:
                on_result(key, known, restored)
    return found


def _add(
    scores: Scores, known: KnownCapture, restored: FloatArray, metrics: Sequence[Metric]
) -> None:
    scores.psf.add(known.psf)
    values = scores.by_picture.setdefault(known.picture, {})
    for metric in metrics:
        for name, value in metric.measure(restored, known.sharp).items():
            values.setdefault(name, []).append(value)


def mean_and_spread(values: Iterable[float]) -> tuple[float | None, float | None]:
    """Give mean and standard deviation (n - 1); None for what the count does not allow."""
    known = list(values)
    mean = statistics.fmean(known) if known else None
    return mean, statistics.stdev(known) if len(known) > 1 else None


def mean_gain(scores: Scores, other: Scores, column: str) -> float | None:
    """Give the mean over pictures of the gain over another method; None without pictures."""
    gains = _gains(scores, other, column)
    return statistics.fmean(gains) if gains else None


def standard_error_of_gain(scores: Scores, other: Scores, column: str) -> float | None:
    """Give the standard error over pictures of the gain over another; None for fewer than two.

    The gain is taken picture by picture, so that the contents of the pictures, which move all
    methods alike, cancel.
    """
    gains = _gains(scores, other, column)
    return statistics.stdev(gains) / math.sqrt(len(gains)) if len(gains) > 1 else None


def _gains(scores: Scores, other: Scores, column: str) -> list[float]:
    base = other.picture_means(column)
    return [v - base[p] for p, v in scores.picture_means(column).items() if p in base]

"""Part of a kind of camera in `camkit bench`.

A kind either photographs pictures, and is timed and judged by the bench; or its captures are no
photographs, and it measures itself.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.report.bench.metric import Metric
from camkit.report.bench.trial import Axes, Entrant, Ground, Skip, Trial
from camkit.report.quality import FIELD_SHARES, Exposed, Shot, expose

Tell = Callable[[str], None]
MakeTrials = Callable[[Entrant, Axes, Ground], tuple[list[Trial], list[Skip]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RowMaker:
    """Makes the rows of one sort, as trials that are not measured yet.

    Attributes:
        name: Stands under `kind` in its rows.
        methods: Names that `--methods` takes for it.
        trials: Gives the trials of a bundle, and what was asked for but cannot be measured; called
            only if one of its methods is wanted.
    """

    name: str
    methods: tuple[str, ...]
    trials: MakeTrials


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnSettings:
    """Settings for a kind that measures itself.

    Attributes:
        data: Folder of pictures to measure accuracy on; None for scenes of the kind's own.
        images: Only the first N of them; None for all.
        sizes: Of networks; None for all that the bundle holds.
        quick: Whether a rough picture in little time will do.
        repeat: How often seconds are taken; the median is told.
    """

    data: Path | None = None
    images: int | None = None
    sizes: tuple[str, ...] | None = None
    quick: bool = False
    repeat: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnRows:
    """Rows that a kind measured of a bundle.

    Attributes:
        rows: Plain JSON values, each row with the columns of its sort.
        skips: What was asked for, or is usual, and could not be measured.
        other_bundles: Other bundles whose networks took part.
    """

    rows: Sequence[Mapping[str, Any]]
    skips: Sequence[Skip] = ()
    other_bundles: Sequence[Bundle] = ()


Measure = Callable[[Bundle, OwnSettings, Tell], OwnRows]


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchPart:
    """A kind of camera in the bench; as it is, one whose captures are photographs.

    Attributes:
        photograph: (place and noise, sharp picture (3, h, w), bundle, lens) -> capture and truth.
        positions: Places of a picture on the sensor, as indices into `FIELD_SHARES`.
        isos: Sensitivities.
        rows: Row makers of its own; one called as a common maker stands in its place.
        metrics: Of its own, beside the common ones; the kind names those that count.
        source: Of the register of scenes (`camkit.scenes`): its scenes are photographed
            where there is no folder of pictures; None takes the golden cases.
        measure: Measures a bundle in place of all that; None for photographs.
    """

    photograph: Callable[[Shot, FloatArray, Bundle, FrozenOptics], Exposed] = expose
    positions: tuple[int, ...] = tuple(range(len(FIELD_SHARES)))
    isos: tuple[float, ...] = (100.0, 1600.0)
    rows: tuple[RowMaker, ...] = ()
    metrics: tuple[Metric, ...] = ()
    source: str | None = None
    measure: Measure | None = None

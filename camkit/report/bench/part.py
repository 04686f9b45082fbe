"""What `camkit bench` asks of a kind of camera."""

from collections.abc import Callable
from dataclasses import dataclass

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray, FrozenPsf
from camkit.report.bench.metric import Metric
from camkit.report.bench.row_maker import RowMaker
from camkit.report.quality import FIELD_SHARES, Exposed, Shot


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchPart:
    """A kind of camera in the bench.

    Attributes:
        photograph: (place and noise, sharp picture (3, h, w), bundle, lens) -> capture and truth.
        positions: Places of a picture on the sensor, as indices into `FIELD_SHARES`.
        isos: Sensitivities.
        rows: Row makers of its own; one called as a common maker stands in its place.
        metrics: Of its own, beside the common ones; the kind names those that count.
        source: Of the register of scenes (`camkit.scenes.named`): its scenes are photographed
            where there is no folder of pictures; None takes the golden cases.
    """

    photograph: Callable[[Shot, FloatArray, Bundle, FrozenPsf], Exposed]
    positions: tuple[int, ...] = tuple(range(len(FIELD_SHARES)))
    isos: tuple[float, ...] = (100.0, 1600.0)
    rows: tuple[RowMaker, ...] = ()
    metrics: tuple[Metric, ...] = ()
    source: str | None = None

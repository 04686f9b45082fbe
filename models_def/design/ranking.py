"""Single errors ranked twice: by what the recovered picture loses, and by spots."""

from dataclasses import dataclass

from scipy.stats import spearmanr

from camkit.models_def.optics.tolerance.deviation import Single
from camkit.models_def.optics.tolerance.errors import ErrorClass


@dataclass(frozen=True, slots=True, kw_only=True)
class Offender:
    """One error at one limit.

    Attributes:
        single: The error.
        loss_db: PSNR after recovery that the design has more, the mean over fields.
        spot_growth_mm: Of the RMS radius over all fields.
    """

    single: Single
    loss_db: float
    spot_growth_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranked:
    """One error of one part, by the worse of its two limits.

    Attributes:
        single: The error at the limit that loses more.
        loss_db: There, the larger of both.
        spot_growth_mm: There.
        worst_spot_growth_mm: At the limit with the larger spots, which may be the other one.
        loss_place: Its place by loss, from 1.
        spot_place: Its place by the larger growth of its limits, from 1.
    """

    single: Single
    loss_db: float
    spot_growth_mm: float
    worst_spot_growth_mm: float
    loss_place: int
    spot_place: int


def rank_errors(offenders: tuple[Offender, ...]) -> tuple[Ranked, ...]:
    """Return every error of every part once, the largest loss first."""
    by_part: dict[tuple[ErrorClass, int | None], list[Offender]] = {}
    for one in offenders:
        by_part.setdefault((one.single.error_class, one.single.part), []).append(one)
    growths = {part: max(o.spot_growth_mm for o in limits) for part, limits in by_part.items()}
    worst = {part: max(limits, key=lambda o: o.loss_db) for part, limits in by_part.items()}
    spot_order = sorted(growths, key=lambda part: -growths[part])
    loss_order = sorted(worst, key=lambda part: -worst[part].loss_db)
    return tuple(
        Ranked(
            single=worst[part].single,
            loss_db=worst[part].loss_db,
            spot_growth_mm=worst[part].spot_growth_mm,
            worst_spot_growth_mm=growths[part],
            loss_place=place,
            spot_place=1 + spot_order.index(part),
        )
        for place, part in enumerate(loss_order, start=1)
    )


def rank_agreement(ranking: tuple[Ranked, ...]) -> float | None:
    """Return Spearman's coefficient of both orders, 1 for the same; None of fewer than 3 errors."""
    if len(ranking) < 3:
        return None
    places = [one.loss_place for one in ranking], [one.spot_place for one in ranking]
    return float(spearmanr(*places).statistic)

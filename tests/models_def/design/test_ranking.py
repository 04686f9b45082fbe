import pytest

from camkit.models_def.design.ranking import Offender, rank_agreement, rank_errors
from camkit.models_def.optics.tolerance.deviation import Single
from camkit.models_def.optics.tolerance.errors import ErrorClass


def one(error_class: ErrorClass, part: int | None, value: float, db: float, mm: float) -> Offender:
    single = Single(error_class=error_class, part=part, value=value)
    return Offender(single=single, loss_db=db, spot_growth_mm=mm)


OFFENDERS = (
    one("radius", 1, 0.1, 0.2, 5.0),
    one("radius", 1, -0.1, 0.9, -4.0),
    one("radius", 2, 0.1, 1.5, 1.0),
    one("radius", 2, -0.1, 0.3, 2.0),
    one("focus", None, 0.1, 0.1, 3.0),
    one("focus", None, -0.1, 0.0, 0.0),
)


def test_each_part_stands_once_by_the_worse_of_its_limits() -> None:
    ranking = rank_errors(OFFENDERS)
    rows = [
        (r.single.error_class, r.single.part, r.loss_db, r.spot_growth_mm, r.spot_place)
        for r in ranking
    ]
    assert rows == [
        ("radius", 2, 1.5, 1.0, 3),
        ("radius", 1, 0.9, -4.0, 1),
        ("focus", None, 0.1, 3.0, 2),
    ]
    assert [r.loss_place for r in ranking] == [1, 2, 3]
    assert ranking[1].single.value == -0.1
    assert [r.worst_spot_growth_mm for r in ranking] == [2.0, 5.0, 3.0]


def test_agreement_is_1_for_the_same_order_and_less_1_for_the_opposite() -> None:
    same = [one("index", i, 0.1, float(i), float(i)) for i in range(4)]
    opposite = [one("index", i, 0.1, float(i), -float(i)) for i in range(4)]
    assert rank_agreement(rank_errors(tuple(same))) == pytest.approx(1)
    assert rank_agreement(rank_errors(tuple(opposite))) == pytest.approx(-1)
    # 1 - 6 sum d^2 / (n (n^2 - 1)), the places differ by 2, 1 and 1
    assert rank_agreement(rank_errors(OFFENDERS)) == pytest.approx(1 - 6 * 6 / 24)
    assert rank_agreement(rank_errors(OFFENDERS[:4])) is None
    assert rank_agreement(()) is None

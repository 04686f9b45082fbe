"""The Pareto front against its definition."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camkit.report.bench.pareto import Point, pareto_front

COORDINATES = st.integers(0, 6).map(float)


def dominates(one: Point, other: Point) -> bool:
    return one[0] <= other[0] and one[1] >= other[1] and one != other


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(COORDINATES, COORDINATES), max_size=12))
def test_the_front_holds_every_point_that_none_dominates_once(points: list[Point]) -> None:
    wanted = {p for p in points if not any(dominates(q, p) for q in points)}
    front = [points[i] for i in pareto_front(points)]
    assert len(front) == len(set(front))
    assert set(front) == wanted
    assert front == sorted(front)

"""Glasses near in n_d and V_d, against a search of all by hand."""

import math

import pytest

from camkit.models_def.optics.glass.agf import parse_agf
from camkit.models_def.optics.glass.catalogue import builtin_catalogues
from camkit.models_def.optics.glass.dispersion import index_and_abbe
from camkit.models_def.optics.glass.nearness import (
    ABBE_STEP,
    FARTHEST,
    INDEX_STEP,
    MOST,
    near_glasses,
    near_text,
)


@pytest.mark.parametrize(("index_d", "abbe"), [(1.5168, 64.17), (1.601, 50.28), (1.72, 29.0)])
def test_the_nearest_glasses_are_those_of_a_full_search(index_d: float, abbe: float) -> None:
    def distance(name: str, n: float, v: float) -> tuple[float, str]:
        return math.hypot((n - index_d) / INDEX_STEP, (v - abbe) / ABBE_STEP), name

    makers = (g for c in builtin_catalogues() if not c.literature for g in c.glasses)
    ranked = sorted(distance(g.name, *index_and_abbe(g)) for g in makers)
    found = near_glasses(index_d, abbe)
    assert found
    assert len(found) <= MOST
    for glass, (wanted, _) in zip(found, ranked, strict=False):
        away, _ = distance(glass.name, *index_and_abbe(glass))
        # printed numbers have five and two digits
        assert away == pytest.approx(wanted, abs=0.03)
        assert away < FARTHEST + 0.03


def test_nothing_is_near_to_numbers_that_no_glass_has() -> None:
    assert near_glasses(3.5, 20) == ()


def test_an_unknown_abbe_number_leaves_the_index_alone() -> None:
    glass = near_glasses(1.50801, 0.0)[0]
    assert index_and_abbe(glass)[0] == pytest.approx(1.50801, abs=1e-3)


def test_glasses_of_the_user_are_among_them() -> None:
    mine = parse_agf("NM FOO 2 0 1.7777 77\nCD 2.13 0.01\nLD 0.3 2\n", "mine")
    (glass,) = near_glasses(1.7777, 77.0, [mine])
    assert glass.name == "FOO-mine"
    assert near_text([glass]) == "FOO-mine (1.77770, 77.00)"


def test_a_glass_of_the_user_stands_for_its_namesake() -> None:
    """Two glasses of one name and equal distance cannot be put in order by themselves."""
    mine = parse_agf("NM N-BK7 2 0 1.5168 64.17\nCD 1.3 0.01\nLD 0.3 2\n", "Schott")
    found = near_glasses(1.5168, 64.17, [mine])
    assert found[0] is mine.glasses[0]
    assert [glass.name for glass in found].count("N-BK7-Schott") == 1

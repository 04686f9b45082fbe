"""Break points of margins whose answer is known."""

import numpy as np
import pytest

from camkit.report.stress.break_point import (
    TIE_DB,
    Margins,
    find_break,
    margins_of,
    sound_values,
)

VALUES = np.array([1.0, 2.0, 4.0, 8.0])


def _margins(gain: np.ndarray, **changes: object) -> Margins:
    fields: dict[str, object] = {
        "values": VALUES,
        "nominal": 0,
        "gains": {"below input": gain},
        "faults": np.zeros(gain.shape, dtype=bool),
    }
    return Margins(**(fields | changes))  # type: ignore[arg-type]


def _same(*rows: float) -> np.ndarray:
    return np.repeat(np.array(rows, dtype=float)[:, None], 5, axis=1)


def test_the_break_lies_where_the_margin_crosses_zero() -> None:
    found = find_break(_margins(_same(3, 1, -1, -5)), "M", "up")
    assert found.point == pytest.approx(3.0)
    assert found.reason == "below input"
    assert found.ci == (pytest.approx(3.0), pytest.approx(3.0))
    logarithmic = find_break(_margins(_same(3, 1, -1, -5), log=True), "M", "up")
    assert logarithmic.point == pytest.approx(np.sqrt(8))


def test_without_order_the_first_broken_value_is_named() -> None:
    assert find_break(_margins(_same(3, 1, -1, 2), ordered=False), "M", "up").point == 4.0


def test_a_method_that_never_breaks_has_no_point() -> None:
    found = find_break(_margins(_same(3, 2, 1, 0)), "M", "up")
    assert (found.point, found.ci, found.reason) == (None, (None, None), "")


def test_both_sides_are_looked_at_from_the_nominal_outwards() -> None:
    margins = _margins(_same(-3, 1, 2, -2), nominal=2)
    assert find_break(margins, "M", "up").point == pytest.approx(6.0)
    assert find_break(margins, "M", "down").point == pytest.approx(1.75)
    np.testing.assert_array_equal(sound_values(margins), [False, True, True, False])


def test_what_is_sound_again_beyond_a_break_is_not_trusted() -> None:
    margins = _margins(_same(3, -1, 3, 3))
    np.testing.assert_array_equal(sound_values(margins), [True, False, False, False])


def test_a_break_at_the_nominal_value_is_the_nominal_value() -> None:
    found = find_break(_margins(_same(-1, -1, -1, -1)), "M", "up")
    assert (found.point, found.reason) == (1.0, "below input")


def test_the_first_rule_to_cross_gives_the_reason() -> None:
    gains = {"below input": _same(2, 2, -2, -2), "chi2": _same(0.3, 0.1, -0.3, -1)}
    found = find_break(_margins(_same(0), gains=gains, faults=np.zeros((4, 5), bool)), "M", "up")
    assert found.reason == "chi2"
    assert found.point == pytest.approx(2.5)


def test_a_fault_on_one_scene_breaks_at_its_value() -> None:
    faults = np.zeros((4, 5), dtype=bool)
    faults[2, 3] = True
    found = find_break(_margins(_same(3, 3, 3, 3), faults=faults), "M", "up")
    assert (found.point, found.reason) == (4.0, "fault")


def test_unknown_scenes_do_not_count_and_unknown_values_do_not_break() -> None:
    gain = _same(3, 1, -1, -1)
    gain[2, :4] = np.nan
    assert find_break(_margins(gain), "M", "up").point == pytest.approx(3.0)
    gain[2:] = np.nan
    assert find_break(_margins(gain), "M", "up").point is None


def test_the_confidence_widens_with_the_spread_of_the_scenes_and_may_have_no_end() -> None:
    rng = np.random.default_rng(1)
    widths = []
    for spread in (0.05, 0.5):
        gain = _same(3, 1, -1, -5) + spread * rng.standard_normal((4, 5))
        low, high = find_break(_margins(gain), "M", "up").ci
        assert low is not None
        assert high is not None
        assert low <= high
        widths.append(high - low)
    assert widths[1] > 3 * widths[0] > 0
    torn = _same(3, 3, 3, 3)
    torn[3] = [-20, 1, 1, 1, 1]
    found = find_break(_margins(torn), "M", "up")
    assert found.point is not None
    assert found.ci[1] is None


def test_the_bootstrap_covers_the_truth_about_as_often_as_it_says() -> None:
    # Mean margins 1 and -1 at 2 and 4 cross at 3; scenes scatter around them.
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(100):
        gain = np.array([3, 1, -1, -5])[:, None] + 0.5 * rng.standard_normal((1, 12))
        low, high = find_break(_margins(gain), "M", "up").ci
        hits += low is not None and high is not None and low <= 3 <= high
    assert 84 <= hits <= 99


def test_a_tie_is_no_break_and_one_more_hundredth_is() -> None:
    psnr = {"M": np.full((1, 2), 30 - TIE_DB), "wiener": np.full((1, 2), 30.0)}
    gains = margins_of(psnr, np.ones((1, 2)), method="M", rivals=["wiener", "M"])
    assert set(gains) == {"below wiener", "chi2"}
    np.testing.assert_allclose(gains["below wiener"], 0, atol=1e-12)
    psnr["M"] -= 0.01
    assert (
        margins_of(psnr, np.ones((1, 2)), method="M", rivals=["wiener"])["below wiener"] < 0
    ).all()

"""Gains are paired over scenes, and a network must surely beat its filter."""

import numpy as np
import pytest

from camkit.report.making.camera_judging import FILTER, Judgement, best_size

SCENES = ("a", "a", "b", "b", "c", "c")


def judgement(*psnr_db: float) -> Judgement:
    return Judgement(psnr_db=psnr_db, scenes=SCENES)


def test_the_error_of_a_gain_is_that_over_scenes() -> None:
    base = judgement(20, 30, 25, 35, 22, 32)
    other = judgement(21, 31, 25, 37, 25, 35)
    gain_db, error_db = other.gain_over(base)
    means = np.array([1.0, 1.0, 3.0])
    assert gain_db == pytest.approx(means.mean())
    assert error_db == pytest.approx(means.std(ddof=1) / np.sqrt(3))


def test_a_network_is_shipped_if_it_surely_beats_the_filter() -> None:
    flat = judgement(*[20.0] * 6)
    judged = {
        FILTER: flat,
        "S": judgement(20.1, 20.1, 20.2, 20.2, 20.3, 20.3),
        "M": judgement(19, 19, 20, 20, 22, 22),
        "L": judgement(*[20.0] * 6),
    }
    assert best_size(judged, ["S"]) == "S"
    # as good on average, and by chance
    assert best_size(judged, ["M"]) is None
    assert best_size(judged, ["L"]) is None
    assert best_size(judged, ["S", "M", "L"]) == "S"

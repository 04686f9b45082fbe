"""Times of flight are judged by their bound, and pixels of background alone by what is believed."""

import numpy as np
import pytest

from camkit.report.kinds.spad import timing
from camkit.report.kinds.spad.synthetic import AXIS, Light, bound_ps, draw
from camkit.report.kinds.spad.timing import measure, timing_rows

PIXELS = 2048


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "SHAPE", (8, 256))
    monkeypatch.setattr(timing, "FITTED", 30)


def test_the_matched_bank_is_nearer_to_the_bound_than_what_else_there_is() -> None:
    rows = {row["method"]: row for row in measure(Light(photons=300, sbr=np.inf), PIXELS, 1)}
    ratios = {name: rows[name]["rmse_over_crb"] for name in timing.METHODS}
    assert 0.95 < ratios["log"] < 1.1 < ratios["lsq"] < ratios["argmax"]
    assert rows["curve_fit"]["cpu_seconds"] > 5 * rows["log"]["cpu_seconds"]
    assert rows["log"]["sigma_68"] == pytest.approx(1, abs=0.1)
    assert {row["sbr"] for row in rows.values()} == {None}
    assert {row["false_alarms"] for row in rows.values()} == {None}


def test_background_alone_is_seldom_believed() -> None:
    row, *_ = measure(Light(photons=100, sbr=1), PIXELS, 1)
    assert row["false_alarms"] <= 5e-3


def test_a_rough_picture_has_few_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "measure", lambda light, *_: [{"photons": light.photons}])
    told: list[str] = []
    assert len(list(timing_rows(1, told.append, quick=True))) == len(timing.QUICK)
    assert told[0] == "times of flight, 30 photons, SBR inf"
    assert len(list(timing_rows(1, told.append))) == len(timing.PHOTONS) * len(timing.SBRS)


def test_the_bound_falls_with_the_root_of_the_photons() -> None:
    times = np.array([800.0, 1200.0])
    dim, bright = (bound_ps(times, Light(photons=n, sbr=3)) for n in (100.0, 400.0))
    assert dim / bright == pytest.approx(2)


def test_photons_that_are_drawn_are_those_asked_for() -> None:
    rng = np.random.default_rng(1)
    light = Light(photons=200, sbr=2)
    times = np.full(2000, 1000.0)
    assert draw(times, light, rng, empty=True).mean() == pytest.approx(100 / AXIS.bins, rel=0.02)
    assert draw(times, light, rng).sum(axis=1).mean() == pytest.approx(300, rel=0.02)

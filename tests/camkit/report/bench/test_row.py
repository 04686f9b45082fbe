"""Rows: every column is there, what is unknown is None, and shares follow their definition."""

import json
from pathlib import Path

import pytest

from camkit.report.bench.accuracy import INPUT, SUPPLIED, Scores
from camkit.report.bench.metric import Column, Metric
from camkit.report.bench.output import flatten
from camkit.report.bench.row import make_row
from camkit.report.bench.timed.process_run import Run
from tests.bench_factory import make_facts, make_run, make_scores, make_trial

PROMISED = {
    *("bundle", "method", "size", "mode", "dtype", "provider", "threads", "width", "height"),
    *("n", "seconds_median", "seconds_p90", "peak_rss_mb", "psf", "psnr_db", "ssim"),
    *("input_psnr_db", "images", "noisy", "stages", "mp_per_s", "s_per_24mp", "mac_per_px"),
    *("share_of_gemm_peak", "seconds_first", "seconds_min", "seconds_p99", "error"),
}


def test_a_row_joins_seconds_memory_and_accuracy() -> None:
    row = make_row(make_trial(), [make_run(8.0), make_run(12.0)], make_facts())
    assert set(row) >= PROMISED
    assert (row["n"], row["seconds_first"], row["seconds_min"]) == (2, 8, 8)
    assert row["seconds_median"] == 10
    assert row["seconds_p90"] == pytest.approx(11.6)
    assert row["seconds_p99"] is None
    assert row["seconds_ratio"] == 2
    assert row["steady_seconds_median"] == 9
    assert row["mp_per_s"] == pytest.approx(1.2)
    assert row["s_per_24mp"] == pytest.approx(20)
    assert row["stages"] == {"network": 5.0, "write": 1.0}
    # 10,000 MAC x 12 MP in 5 s are 24 GMAC/s of 100
    assert row["share_of_gemm_peak"] == pytest.approx(0.24)
    assert row["peak_rss_mb"] == 1000
    assert row["noisy"] is True  # p90 is 1.16 times the median
    assert (row["psf"], row["images"], row["captures"]) == ("fresh", 2, 4)
    assert (row["psnr_db"], row["input_psnr_db"]) == (27, 21)
    assert row["psnr_std_db"] == pytest.approx(8**0.5)
    assert row["gain_se_psnr_db"] == pytest.approx(1.0)  # gains of 5 and 7
    assert row["ssim"] == pytest.approx(0.6)
    assert row["error"] is None
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_a_failed_row_holds_its_reason_and_nothing_made_up() -> None:
    facts = make_facts(scores={}, base=[])
    row = make_row(make_trial(), [Run(error="no memory")], facts)
    assert set(row) >= PROMISED
    assert row["error"] == "no memory"
    assert row["n"] == row["images"] == 0
    for name in ("seconds_median", "peak_rss_mb", "psnr_db", "input_psnr_db", "noisy", "psf"):
        assert row[name] is None, name
    assert row["share_of_gemm_peak"] is None


def test_the_developed_row_has_the_accuracy_of_the_input() -> None:
    trial = make_trial(path=None, maker="develop", method="develop", size=None, provider=None)
    row = make_row(trial, [make_run(1.0)], make_facts(mac_per_px=None))
    assert row["psnr_db"] == row["input_psnr_db"] == 21
    assert row["gain_se_psnr_db"] is None
    assert row["share_of_gemm_peak"] is None


def test_a_share_above_one_is_unknown() -> None:
    row = make_row(make_trial(), [make_run(1.0)], make_facts(gemm_gmac_per_s=1.0))
    assert row["share_of_gemm_peak"] is None


def test_speed_on_another_provider_is_not_held_against_the_cpu() -> None:
    row = make_row(make_trial(provider="cuda"), [make_run(1.0)], make_facts())
    assert row["share_of_gemm_peak"] is None


def test_trials_carry_no_paths_into_rows() -> None:
    row = make_row(make_trial(path=Path("/secret/duet.camkit")), [make_run(1.0)], make_facts())
    assert "secret" not in json.dumps(row)


def test_the_input_is_what_captures_bring_if_they_bring_it() -> None:
    scores = make_facts().scores | {SUPPLIED: make_scores({"a": 24.0, "b": 27.0})}
    row = make_row(make_trial(), [make_run(1.0)], make_facts(scores=scores))
    assert (row["psnr_db"], row["input_psnr_db"]) == (27, 25.5)
    assert row["gain_se_psnr_db"] == pytest.approx(0.5)  # gains of 1 and 2
    trial = make_trial(path=None, maker="develop", method="develop", size=None, provider=None)
    developed = make_row(trial, [make_run(1.0)], make_facts(scores=scores))
    assert (developed["psnr_db"], developed["input_psnr_db"]) == (21, 25.5)


def test_a_metric_may_add_plain_columns_notes_and_the_numbers_of_every_picture() -> None:
    def measure(*_: object) -> dict[str, float]:
        raise AssertionError

    metric = Metric(
        name="hdr",
        columns=(Column(name="stops", of_input="input_stops"), Column(name="guess")),
        measure=measure,
        notes=lambda: {"display": "24 inch"},
        each_picture=True,
    )
    scores = {
        make_trial().accuracy_key: Scores(
            by_picture={"a": {"stops": [1.0, 3.0], "guess": [5.0, 5.0]}, "b": {"guess": [6.0]}}
        ),
        INPUT: Scores(by_picture={"a": {"stops": [4.0]}}),
    }
    row = make_row(make_trial(), [make_run(1.0)], make_facts(metrics=(metric,), scores=scores))
    assert {"gain_se_stops", "over_base_stops", "psnr_db"}.isdisjoint(row)
    assert (row["stops"], row["input_stops"], row["guess"]) == (2, 4, 5.5)
    assert (row["display"], row["captures"]) == ("24 inch", 3)
    assert row["pictures"] == {"a": {"stops": 2, "input_stops": 4, "guess": 5}, "b": {"guess": 6}}
    assert "pictures" not in flatten(row)
    nothing = make_row(make_trial(), [], make_facts(metrics=(metric,), scores={}))
    assert (nothing["stops"], nothing["input_stops"], nothing["pictures"]) == (None, None, {})

"""The metric of high dynamic range: its columns, what it takes from a capture, and JOD."""

import math
from typing import Any

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.bench.metrics import hdr
from camkit.report.bench.metrics.hdr import METRIC
from camkit.report.bench.row import make_row
from camkit.report.hdr_score import NITS_PER_UNIT, Reference, guess_scores, hdr_scores
from camkit.report.quality import BORDER_PX
from tests.bench_factory import make_facts, make_run, make_trial
from tests.hdr_pictures import hdr_pair

RESULT, TRUTH = hdr_pair(2 * BORDER_PX + 40)
BESIDE: dict[str, Any] = {
    "linear": TRUTH,
    "clipped": TRUTH >= 1,
    "input": np.minimum(TRUTH, 1),
}
INNER = np.s_[:, BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX]
PROMISED = (
    *("hdr_psnr_db", "input_hdr_psnr_db", "stops_rmse", "stops_rmse_guess", "unclipped_psnr_db"),
    *("input_unclipped_psnr_db", "mu_psnr_db", "pu21_psnr_db", "pu21_ssim", "ev0_psnr_db"),
    *("ev4_psnr_db", "ev8_psnr_db", "jod", "input_jod"),
)


def measure(**changes: Any) -> dict[str, float]:
    beside = BESIDE | changes
    return METRIC.measure(beside.pop("result", RESULT), TRUTH, **beside)


@pytest.fixture(autouse=True)
def _without_jod(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdr, "obstacle", lambda: "it is not installed")


def test_a_row_carries_every_promised_number_also_aligned() -> None:
    row = make_row(make_trial(), [make_run(1.0)], make_facts(metrics=(METRIC,)))
    assert set(row) >= {f"{name}{end}" for name in PROMISED for end in ("", "_aligned")}
    assert row["jod_display"] == "not measured: it is not installed"
    assert {"nits_per_unit", "pictures", "gain_se_hdr_psnr_db"} <= set(row)


def test_numbers_are_those_of_the_score_inside_the_border() -> None:
    inner = {name: BESIDE[name][INNER] for name in BESIDE}
    reference = Reference(truth=inner["linear"], clipped=inner["clipped"], bare=inner["input"])
    wanted = hdr_scores(RESULT[INNER], reference) | guess_scores(reference)
    assert measure() == wanted | {"nits_per_unit": NITS_PER_UNIT}
    assert set(wanted) <= {column.name for column in METRIC.columns}
    ruined = RESULT.copy()
    ruined[:, :BORDER_PX] = 0
    assert measure(result=ruined) == measure()


def test_a_capture_that_knows_no_mask_gets_the_other_numbers() -> None:
    found = METRIC.measure(RESULT, TRUTH, linear=TRUTH)
    assert {"unclipped_psnr_db", "stops_rmse_guess"}.isdisjoint(found)
    assert found["hdr_psnr_db"] == measure()["hdr_psnr_db"]


def test_a_result_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ContractError, match="result must be finite"):
        measure(result=np.full_like(RESULT, np.nan))


def test_jod_stands_beside_where_it_can_be_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdr, "obstacle", lambda: None)
    monkeypatch.setattr(hdr, "jod", lambda result, _truth, nits: float(result.max()) * nits)
    found = measure(result=TRUTH * np.float32(0.5), nits_per_unit=2.0)
    peak = float(TRUTH[INNER].max())
    assert (found["jod"], found["nits_per_unit"]) == (pytest.approx(peak), 2)
    assert math.isclose(found["jod_aligned"], 2 * peak, rel_tol=1e-6)
    assert METRIC.notes is not None
    assert "24 inch" in METRIC.notes()["jod_display"]

"""The loss model: one line per target, kept in the manifest's plan."""

import numpy as np
import pytest

from camkit.bundle.manifest import Threshold
from camkit.errors import ContractError
from camkit.runtime.plan.loss import LossModel, plan_entries, read_loss_model
from tests.plan_factory import made_content

MODEL = LossModel(
    lines={"exact": (0.5, 1.0, 0.25, 2.0), "wiener": (-1.0, 0.5, 0.5, 0.0)},
    adaptive_db=0.12,
    draft_db=0.6,
)


def test_model_survives_the_manifest() -> None:
    entries = plan_entries(MODEL, adaptive_cost_db=0.09, draft_cost_db=0.4)
    assert read_loss_model(entries) == MODEL
    assert entries["adaptive.loss_db"] == Threshold(value=0.12, cost_db=0.09)


def test_error_of_a_cell_is_its_line() -> None:
    content = made_content(detail=np.array([[1e-3, 1e-5]]), noise=1e-6, field=0.5)
    losses = MODEL.predict(content)
    seen = np.log([1.3e-3, 1e-5 + 0.3e-3])
    closed = 256 * 256 * np.exp(0.5 + seen + 0.25 * np.log(1e-6) + 2 * 0.5)
    np.testing.assert_allclose(losses.exact[0], closed, rtol=1e-9)
    assert set(losses.extra) == {"wiener"}


def test_allowed_error_is_the_loss_in_decibels() -> None:
    losses = MODEL.predict(made_content(detail=np.full((2, 2), 1e-3)))
    assert losses.loss_db(losses.allowed(0.3)) == pytest.approx(0.3)
    assert losses.loss_db(0.0) == 0.0


def test_budget_of_the_worst_loss_is_the_calibrated_one_at_its_worst() -> None:
    assert MODEL.budget_db(0.3) == pytest.approx(MODEL.adaptive_db)


def test_a_bundle_without_plan_has_no_model() -> None:
    assert read_loss_model(None) is None
    assert read_loss_model({}) is None


def test_a_missing_term_is_named() -> None:
    entries = plan_entries(MODEL, adaptive_cost_db=0.0, draft_cost_db=0.0)
    del entries["wiener.noise"]
    with pytest.raises(ContractError, match=r"wiener\.noise"):
        read_loss_model(entries)

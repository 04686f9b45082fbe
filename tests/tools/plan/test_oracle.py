"""The oracle spends its loss where that saves most, and counts what the plan counts."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.runtime.plan.loss import EXACT
from camkit.runtime.plan.tiers import TierWork
from tests.plan_factory import MODEL, made_content, write_planned_bundle
from tools.plan.cells import CaptureCells
from tools.plan.oracle import ORACLE_DB, oracle_saving, plan_saving, summary_line

WORK = TierWork(full_mac=16_000, full_halo_px=0, small_mac=4_000)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_planned_bundle(Path(tmp_path_factory.mktemp("planned")))


def _cells(extra: np.ndarray) -> CaptureCells:
    """Return a capture that loses `extra` per cell by the bank, a tenth by S, thrice developed."""
    exact = np.ones_like(extra)
    return CaptureCells(
        name="made",
        content=made_content(np.full(extra.shape, 1e-3)),
        pixels=np.full(extra.shape, 65536.0),
        errors={
            EXACT: exact,
            "plain": exact + 3 * extra,
            "wiener": exact + extra,
            "S": exact + 0.1 * extra,
        },
    )


def test_an_oracle_saves_all_that_costs_nothing_and_keeps_its_loss(bundle: Bundle) -> None:
    extra = np.full((6, 8), 5.0)
    extra[:, :4] = 1e-6
    saving = oracle_saving(_cells(extra), bundle, WORK, "S")
    assert saving.tiers[0] >= 0.5
    assert 0.3 < saving.saved < 1
    assert saving.loss_db <= ORACLE_DB + 1e-9


def test_where_everything_costs_too_much_nothing_is_saved(bundle: Bundle) -> None:
    saving = oracle_saving(_cells(np.full((6, 8), 50.0)), bundle, WORK, "S")
    assert (saving.saved, saving.loss_db, saving.tiers[3]) == (0.0, 0.0, 1.0)


def test_a_plan_is_counted_by_what_it_really_loses(bundle: Bundle) -> None:
    saving = plan_saving(_cells(np.full((6, 8), 0.5)), bundle, WORK, "S", MODEL)
    assert 0 <= saving.saved < 1
    assert "1 captures: saves" in summary_line("plan", [saving])

"""The fit finds the lines that made the errors, and a budget that keeps both limits."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.report.quality import BORDER_PX
from camkit.runtime.plan.tiers import TierWork
from tests.plan_factory import made_content
from tools.plan.cells import CaptureCells, cell_sums
from tools.plan.fit import (
    MEAN_DB,
    WORST_DB,
    fit_model,
    true_loss_db,
)

WORK = TierWork(full_mac=16_000, full_halo_px=96, small_mac=4_000, small_halo_px=64)
TARGETS = {
    "exact": (-1.0, 0.8, 0.1, 1.0),
    "wiener": (-2.0, 0.7, 0.3, 1.0),
    "plain": (0.0, 0.9, 0.0, 2.0),
    "S": (-4.0, 0.8, 0.1, 0.5),
}


def _captures(count: int, *, spread: float = 0.0) -> list[CaptureCells]:
    rng = np.random.default_rng(0)
    made = []
    for number in range(count):
        content = made_content(
            np.exp(rng.uniform(-12, -4, (4, 5))),
            noise=float(np.exp(rng.uniform(-12, -8))),
            field=float(rng.uniform(0, 1)),
        )
        area = content.cell_px
        errors = {}
        for target, (level, detail, noise, field) in TARGETS.items():
            exponent = (
                level + detail * np.log(content.blurred_detail) + noise * np.log(content.noise)
            )
            errors[target] = area * np.exp(
                exponent + field * content.field + spread * rng.standard_normal(area.shape)
            )
        for target in ("wiener", "plain", "S"):
            errors[target] = errors[target] + errors["exact"]
        made.append(
            CaptureCells(name=f"capture {number}", content=content, pixels=area, errors=errors)
        )
    return made


def test_fit_finds_the_lines_of_errors_without_spread() -> None:
    made = fit_model(_captures(6), WORK, "S")
    for target, line in TARGETS.items():
        if target != "S":  # its excess is partly below the share that counts
            np.testing.assert_allclose(made.model.lines[target], line, atol=0.05)


def test_budget_keeps_mean_and_worst_loss() -> None:
    captures = _captures(6, spread=0.5)
    made = fit_model(captures, WORK, "S")
    assert made.adaptive[0] <= MEAN_DB
    assert made.adaptive[1] <= WORST_DB
    assert made.model.draft_db > made.model.adaptive_db
    free = TierWork(full_mac=16_000, full_halo_px=0, small_mac=4_000)
    lost = [true_loss_db(c, made.model, free, "S", made.model.adaptive_db) for c in captures]
    assert np.mean(lost) == pytest.approx(made.adaptive[0])
    assert max(lost) == pytest.approx(made.adaptive[1])


def test_too_few_cells_are_refused() -> None:
    with pytest.raises(ContractError, match="too few"):
        fit_model(_tiny(), WORK, "S")


def _tiny() -> list[CaptureCells]:
    content = made_content(np.full((1, 2), 1e-3))
    errors = dict.fromkeys(TARGETS, content.cell_px * 0.001)
    return [CaptureCells(name="tiny", content=content, pixels=content.cell_px, errors=errors)]


def test_cells_are_summed_without_the_border() -> None:
    sums = cell_sums(np.ones((300, 520), np.float32))
    assert sums.shape == (2, 3)
    assert sums.sum() == (300 - 2 * BORDER_PX) * (520 - 2 * BORDER_PX)
    assert sums[0, 1] == (256 - BORDER_PX) * (520 - BORDER_PX - 256)

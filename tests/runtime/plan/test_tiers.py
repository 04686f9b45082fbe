"""Cells are shared among the tiers with the least work within the loss."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.content import CELL_PX
from camkit.runtime.plan.decision import FULL, PLAIN, SMALL, WIENER
from camkit.runtime.plan.tiers import TierWork, choose_tiers, total_work

WORK = TierWork(full_mac=16_000, full_halo_px=96, small_mac=4_000, small_halo_px=64)
NO_HALO = replace(WORK, full_halo_px=0, small_halo_px=0)


def _area(rows: int, columns: int) -> np.ndarray:
    return np.full((rows, columns), float(CELL_PX**2))


def _losses(full: np.ndarray, *, plain: bool = False) -> np.ndarray:
    """Give losses of the tiers for cells that the bank alone makes worse by `full`."""
    grid = np.stack([3 * full, full, 0.1 * full, np.zeros_like(full)])
    if not plain:
        grid[PLAIN] = np.inf
    return grid


def test_choice_is_the_cheapest_of_all_labellings_that_keep_the_loss() -> None:
    losses = _losses(np.array([[0.1, 1.0], [3.0, 0.2]]))
    area, allowed = _area(2, 2), 0.55
    labels = choose_tiers(area, losses, allowed, NO_HALO)
    assert labels is not None
    costs = NO_HALO.per_px()[:, None, None] * area
    borders = NO_HALO.borders()
    best = np.inf
    for tiers in product((WIENER, SMALL, FULL), repeat=4):
        tried = np.array(tiers).reshape(2, 2)
        spent = np.take_along_axis(losses, tried[None], axis=0).sum()
        if spent <= allowed:
            best = min(best, total_work(tried, costs, borders))
    got = total_work(labels, costs, borders)
    spent = np.take_along_axis(losses, labels[None].astype(int), axis=0).sum()
    assert spent <= allowed
    # Weighted sums reach the convex hull of all labellings; here that is within a tenth.
    assert best <= got <= 1.1 * best


def test_nothing_to_spend_means_nothing_is_skipped() -> None:
    assert choose_tiers(_area(4, 4), _losses(np.ones((4, 4))), 1e-3, WORK) is None


def test_free_cells_lose_their_network() -> None:
    full = np.ones((6, 8))
    full[:, :4] = 1e-9
    labels = choose_tiers(_area(6, 8), _losses(full), 1e-3, WORK)
    assert labels is not None
    assert (labels[:, :4] == WIENER).all()
    assert (labels[:, 4:] == FULL).all()


def test_a_lone_cheap_cell_keeps_its_network_since_a_border_costs_more() -> None:
    full = np.ones((5, 5))
    full[2, 2] = 1e-9
    assert choose_tiers(_area(5, 5), _losses(full), 1e-3, WORK) is None


def test_black_cells_are_not_even_filtered() -> None:
    full = np.ones((6, 8))
    full[:, :5] = 1e-9
    labels = choose_tiers(_area(6, 8), _losses(full, plain=True), 1e-3, WORK)
    assert labels is not None
    assert (labels[:, :4] == PLAIN).all()


def test_without_a_smaller_network_its_tier_is_never_taken() -> None:
    work = TierWork(full_mac=16_000, full_halo_px=96)
    labels = choose_tiers(_area(4, 4), _losses(np.full((4, 4), 1e-6)), 1.0, work)
    assert labels is not None
    assert not (labels == SMALL).any()


def test_losses_of_another_shape_are_refused() -> None:
    with pytest.raises(ContractError, match="losses"):
        choose_tiers(_area(2, 2), np.zeros((4, 3, 3)), 1.0, WORK)

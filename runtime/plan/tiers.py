"""Cells shared among the tiers: the least work within a loss, borders between tiers counted.

    work = sum over cells of area * work(tier) + sum over borders of CELL_PX * halo * work(network)

Where a network's cells end, its windows reach a halo further; a lone cell of 256 px with a halo of
96 costs three cells. The least of work + weight * loss is sought cell by cell in a checkerboard
(iterated conditional modes), for a row of weights; the cheapest result within the loss is taken,
and what it leaves of the loss is spent cell by cell.
Everything is in multiplications, none of it depends on the machine.

References: Besag 1986 (iterated conditional modes).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.runtime.content import CELL_PX, CellArray
from camkit.runtime.plan.decision import FULL, PLAIN, SMALL, Labels

BANK_MAC: Final = 8_000.0
"""Work of the bank per pixel, in multiplications of a network that take as long (measured:
docs/results/plan.md)."""
NETWORK_FIXED_MAC: Final = 3_300.0
"""Costs of a network per pixel of its windows besides its multiplications, in the same unit."""
NETWORK_EVERYWHERE_MAC: Final = 7_600.0
"""Costs of a network per pixel of the picture, in whatever cells it runs: the way to equal noise
and back, and the bound of its light. No plan saves it."""
LEAST_SAVING: Final = 0.1
"""Below this share of the work nothing is skipped."""
_BANK_REACH_PX: Final = 256
_WEIGHTS: Final = 48
_SWEEPS: Final = 6

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TierWork:
    """Work per pixel and reach of the networks.

    Attributes:
        full_mac: Multiplications per pixel of the network.
        full_halo_px: Its halo.
        small_mac: Those of the smaller network; None without one.
        small_halo_px: Its halo.
    """

    full_mac: float
    full_halo_px: int
    small_mac: float | None = None
    small_halo_px: int = 0

    def per_px(self) -> FloatGrid:
        """Return the work per pixel of every tier, the bank included."""
        small = np.inf if self.small_mac is None else BANK_MAC + network_work(self.small_mac)
        return np.array([0.0, BANK_MAC, small, BANK_MAC + network_work(self.full_mac)])

    def borders(self) -> FloatGrid:
        """Return (tier, tier): work per border of one cell's side between two tiers."""
        ring = np.zeros(4)
        ring[FULL] = network_work(self.full_mac) * self.full_halo_px * CELL_PX
        if self.small_mac is not None:
            ring[SMALL] = network_work(self.small_mac) * self.small_halo_px * CELL_PX
        table = ring[:, None] + ring
        bank = BANK_MAC * _BANK_REACH_PX * CELL_PX
        table[PLAIN, 1:] += bank
        table[1:, PLAIN] += bank
        np.fill_diagonal(table, 0.0)
        return np.asarray(table)


def network_work(mac: float) -> float:
    """Return the work per pixel of the windows of a network of so many multiplications."""
    return NETWORK_FIXED_MAC + mac


def choose_tiers(
    area_px: CellArray, losses: FloatGrid, allowed: float, work: TierWork
) -> Labels | None:
    """Return the tier of every cell, the least work within a loss.

    Args:
        area_px: (row, column) pixels of every cell.
        losses: (tier, row, column) loss of every tier >= 0, FULL = 0; inf where a tier is not to
            be had.
        allowed: Loss of all cells together.
        work: What the tiers cost.

    Returns:
        (row, column) int8, or None where skipping saves less than LEAST_SAVING.

    Raises:
        ContractError: If the shapes disagree.
    """
    if losses.shape != (4, *area_px.shape) or (losses < 0).any() or np.isnan(losses).any():
        raise ContractError(f"losses must be >= 0 and (4, {area_px.shape}); got {losses.shape}")
    per_px = work.per_px()
    usable = np.isfinite(per_px)[:, None, None] & np.isfinite(losses)
    costs = np.where(usable, np.where(np.isfinite(per_px), per_px, 0)[:, None, None] * area_px, 0)
    bounded = np.where(usable, losses, 0)
    forbidden = np.where(usable, 0, np.inf)
    borders = work.borders()
    everything = total_work(np.full(area_px.shape, FULL, np.int8), costs, borders)
    best, least = None, everything * (1 - LEAST_SAVING)
    unit = everything / max(allowed, 1e-30)
    for weight in unit * np.logspace(3, -3, _WEIGHTS):
        labels = _settle(costs + weight * bounded + forbidden, borders)
        loss = float(np.take_along_axis(bounded, labels[None], axis=0).sum())
        amount = total_work(labels, costs, borders)
        if loss <= allowed and amount <= least:
            best, least = labels, amount
    if best is None:
        return None
    return _spend(best, costs, np.where(usable, losses, np.inf), allowed, borders).astype(np.int8)


def total_work(labels: NDArray[np.integer], costs: FloatGrid, borders: FloatGrid) -> float:
    """Return the work of a labelling: cells and borders."""
    cells = np.take_along_axis(costs, labels[None].astype(np.intp), axis=0).sum()
    across = borders[labels[:, :-1], labels[:, 1:]].sum()
    down = borders[labels[:-1], labels[1:]].sum()
    return float(cells + across + down)


def _spend(
    labels: NDArray[np.intp],
    costs: FloatGrid,
    losses: FloatGrid,
    allowed: float,
    borders: FloatGrid,
) -> NDArray[np.intp]:
    """Return labels with single cells changed, as long as that saves work within the loss.

    A weighted sum finds only labellings on the convex hull; what they leave of the loss is spent
    on the cells that save most.
    """
    labels = labels.copy()
    while True:
        energy = costs + _pull(labels, borders)
        saving = np.take_along_axis(energy, labels[None], axis=0) - energy
        current = np.take_along_axis(losses, labels[None], axis=0)
        fits = losses - current <= allowed - current.sum()
        saving = np.where(fits, saving, 0)
        tier, row, column = np.unravel_index(saving.argmax(), saving.shape)
        if saving[tier, row, column] <= 0:
            return labels
        labels[row, column] = tier


def _settle(unary: FloatGrid, borders: FloatGrid) -> NDArray[np.intp]:
    """Return labels that no single cell can better; from the best single cells onwards."""
    labels = unary.argmin(axis=0)
    rows, columns = np.indices(labels.shape)
    parity = (rows + columns) % 2
    for _ in range(_SWEEPS):
        old_labels = labels.copy()
        for turn in (0, 1):
            energy = unary + _pull(labels, borders)
            labels = np.where(parity == turn, energy.argmin(axis=0), labels)
        if (labels == old_labels).all():
            break
    return np.asarray(labels)


def _pull(labels: NDArray[np.intp], borders: FloatGrid) -> FloatGrid:
    """Return (tier, row, column): work of the borders that a tier would have to its neighbours."""
    neighbour_work = borders[:, labels]
    pull = np.zeros_like(neighbour_work)
    pull[:, 1:] += neighbour_work[:, :-1]
    pull[:, :-1] += neighbour_work[:, 1:]
    pull[:, :, 1:] += neighbour_work[:, :, :-1]
    pull[:, :, :-1] += neighbour_work[:, :, 1:]
    return pull

"""Photographs of one lens and setting to its PSF over the field.

photographs -> isolated straight steps (photo_edges) -> a fifth of them is held out
  -> the sharpest of each direction and place (sharp_edges)
  -> blobs of light of all places and colours together (kernel_solve), a few rounds
  -> how far kernels move when an eighth of the edges is left out -> the held-out edges
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from camkit.calibration.blur.blob_basis import Blobs, FloatGrid, FloatLine
from camkit.calibration.blur.edge_fit import (
    EdgeFit,
    fine_places,
    fine_rises,
    fit_edge_place,
    width_factors,
)
from camkit.calibration.blur.kernel_solve import SMOOTHNESS, EdgeSums, solve_weights
from camkit.calibration.blur.photo_edges import PhotoEdge
from camkit.calibration.blur.sharp_edges import direction_of, sharp_halves

NODES: Final = 7
"""Heights of the field at most, from the axis to the farthest corner."""
LEAST_EDGES: Final = 16
"""In all photographs together."""
EDGES_OF_NODE: Final = 25
"""For each height; fewer edges have fewer heights."""
LEAST_OF_NODE: Final = 4.0
"""Edges at a height, for kernels of its own."""
GROUPS: Final = 10
HELD_OUT: Final = (0, 1)
"""Numbers of the groups of edges that kernels are not fitted to."""
ROUNDS: Final = 4
_FIRST_SMOOTHNESS: Final = 1e-4
_BLOB_REACH: Final = 0.85
_WIDTH_ROUNDS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlurModel:
    """Kernels over the field as blobs.

    Attributes:
        blobs: Their places.
        heights_mm: (node,) increasing; where no edges lie there is none.
        weights: (c, node, k).
        varied: (group, c, node, k): the same, each time without a part of the edges.
        smoothness: (c,) of the penalty that was chosen.
        sharp_half: (edge, 2) halves of edges that count.
        shares: (edge, node).
    """

    blobs: Blobs
    heights_mm: FloatLine
    weights: FloatGrid
    varied: FloatGrid
    smoothness: tuple[float, ...]
    sharp_half: NDArray[np.bool_]
    shares: FloatGrid


def node_heights(edges: Sequence[PhotoEdge], radius_mm: float) -> tuple[FloatLine, FloatLine]:
    """Return the heights (node,) that have edges, and those that have too few."""
    number = int(np.clip(len(edges) // EDGES_OF_NODE, 1, NODES))
    heights = np.linspace(0, radius_mm, number)
    counts = height_shares(edges, heights).sum(axis=0)
    enough = counts >= LEAST_OF_NODE
    if not enough.any():
        enough[counts.argmax()] = True
    return heights[enough], heights[~enough]


def height_shares(edges: Sequence[PhotoEdge], heights_mm: FloatLine) -> FloatGrid:
    """Return (edge, node): the share of every height in the kernels at an edge."""
    at = np.array([edge.height_mm for edge in edges])
    return np.stack([np.interp(at, heights_mm, unit) for unit in np.eye(heights_mm.size)], axis=1)


def edge_groups(edges: Sequence[PhotoEdge], radius_mm: float) -> NDArray[np.intp]:
    """Return (edge,) numbers of groups, each of which has edges of all directions and places."""
    order = sorted(
        range(len(edges)),
        key=lambda i: (
            min(int(edges[i].height_mm / radius_mm * NODES), NODES - 1),
            direction_of(edges[i]),
            edges[i].photo,
            edges[i].place_mm,
        ),
    )
    group = np.empty(len(edges), dtype=np.intp)
    group[order] = (
        np.random.default_rng(0)
        .permuted(np.resize(np.arange(GROUPS), (-(-len(edges) // GROUPS), GROUPS)), axis=1)
        .ravel()[: len(edges)]
    )
    return group


def fit_blur(
    edges: Sequence[PhotoEdge], group: NDArray[np.intp], radius_mm: float, reach_px: float
) -> BlurModel:
    """Fit kernels over the field.

    Args:
        edges: Found in the photographs.
        group: (edge,) see `edge_groups`; held-out ones only tell how sharp edges are.
        radius_mm: From the axis to the farthest corner.
        reach_px: To both sides of an edge.
    """
    heights, _ = node_heights(edges, radius_mm)
    fit = _Fit(edges, group, heights, reach_px)
    for number in range(ROUNDS):
        fit.improve(is_last=number == ROUNDS - 1)
    return BlurModel(
        blobs=fit.blobs,
        heights_mm=heights,
        weights=fit.weights,
        varied=fit.varied(),
        smoothness=tuple(fit.smoothness),
        sharp_half=fit.sharp_half,
        shares=fit.shares,
    )


class _Fit:
    """Kernels and edges, improved in turn."""

    def __init__(
        self,
        edges: Sequence[PhotoEdge],
        group: NDArray[np.intp],
        heights_mm: FloatLine,
        reach_px: float,
    ) -> None:
        self.edges, self.group, self.reach_px = edges, group, reach_px
        self.is_round = bool(heights_mm[0] == 0)
        self.shares = height_shares(edges, heights_mm)
        self.blobs = Blobs.of(_BLOB_REACH * reach_px)
        self.colours = len(edges[0].colours)
        self.places = fine_places(reach_px)
        spreads = first_spreads(edges, reach_px)
        self.sharp_half = sharp_halves(edges, spreads, self.shares)
        nodes = heights_mm.size
        sharp_spreads = np.where(self.sharp_half[:, ::-1], spreads, np.nan)
        every = float(np.nanmedian(sharp_spreads))
        first = []
        for n in range(nodes):
            mine = sharp_spreads[self.shares[:, n] > 0.5]
            first.append(
                self.blobs.gaussian(float(np.nanmedian(mine)) if np.isfinite(mine).any() else every)
            )
        self.weights = np.stack([np.stack(first)] * self.colours)
        self.moved_px = np.zeros(len(edges))
        self.smoothness = [_FIRST_SMOOTHNESS] * self.colours
        self.sums: dict[tuple[int, int], EdgeSums] = {}

    def improve(self, *, is_last: bool) -> None:
        """Fit the places of the edges, choose the sharp ones, and solve for the kernels."""
        fits, factors, tables = [], [], []
        for i, edge in enumerate(self.edges):
            table = fine_rises(self.blobs, edge, self.reach_px)
            mixed = np.einsum("n,cnk->ck", self.shares[i], self.weights)
            profiles = mixed @ table.T
            fitted = fit_edge_place(edge, profiles, self.places, start_px=self.moved_px[i])
            self.moved_px[i] = fitted.moved_px
            fits.append(fitted)
            middle = self.colours // 2
            factors.append(width_factors(edge, profiles[middle], self.places, fitted.moved_px))
            tables.append(table.astype(np.float32))
        self.sharp_half = sharp_halves(self.edges, np.array(factors), self.shares)
        self.sums = self._sums(fits, tables)
        for c in range(self.colours):
            trained = self._trained(c)
            if is_last:
                self.smoothness[c] = self._best_smoothness(c, trained)
            self.weights[c] = self._solved(trained, c)

    def varied(self) -> FloatGrid:
        """Return (group, c, node, k): kernels without each group of edges in turn."""
        return np.stack(
            [
                np.stack(
                    [
                        self._solved(self._trained(c).plus(self.sums[g, c], -1), c)
                        for c in range(self.colours)
                    ]
                )
                for g in _trained_groups()
            ]
        )

    def _trained(self, colour: int) -> EdgeSums:
        nodes, count = self.weights.shape[1:]
        total = EdgeSums.empty(nodes, count)
        for g in _trained_groups():
            total = total.plus(self.sums[g, colour])
        return total

    def _solved(self, sums: EdgeSums, colour: int) -> FloatGrid:
        return solve_weights(
            sums,
            self.blobs,
            self.smoothness[colour],
            is_reference=colour == self.colours // 2,
            is_round=self.is_round,
        )

    def _best_smoothness(self, colour: int, trained: EdgeSums) -> float:
        """Return the penalty that explains edges best that were left out."""
        misfits = []
        tests = _trained_groups()[::3]
        for smoothness in SMOOTHNESS:
            self.smoothness[colour] = smoothness
            misfit = 0.0
            for g in tests:
                one = self.sums[g, colour]
                weights = self._solved(trained.plus(one, -1), colour)
                misfit += one.misfit(weights) * one.weight
            misfits.append(misfit)
        return SMOOTHNESS[int(np.argmin(misfits))]

    def _sums(
        self, fits: Sequence[EdgeFit], tables: Sequence[NDArray[np.float32]]
    ) -> dict[tuple[int, int], EdgeSums]:
        nodes, count = self.weights.shape[1:]
        sums = {
            (g, c): EdgeSums.empty(nodes, count) for g in range(GROUPS) for c in range(self.colours)
        }
        trust = edge_trust(fits, self.sharp_half)
        for i, fitted in enumerate(fits):
            for c, colour in enumerate(fitted.colours):
                if colour is None or not self.sharp_half[i].any():
                    continue
                mine = self.sharp_half[i][colour.half]
                rises = rises_at(tables[i], self.places, colour.distance_px[mine])
                weight = colour.weight[mine] * trust[i, c]
                sums[int(self.group[i]), c].add(rises, colour.rise[mine], weight, self.shares[i])
        return sums


def edge_trust(fits: Sequence[EdgeFit], sharp_half: NDArray[np.bool_]) -> FloatGrid:
    """Return (edge, c): less than 1 for edges that kernels explain worse than others.

    A border of a coloured thing, or a line beside it, is no step of light in every colour. Weights
    are those of a Cauchy distribution as wide as the median misfit.
    """
    misfits = np.full((len(fits), len(fits[0].colours)), np.nan)
    for i, fitted in enumerate(fits):
        for c, colour in enumerate(fitted.colours):
            if colour is not None and sharp_half[i].any():
                mine = sharp_half[i][colour.half]
                misfits[i, c] = float(np.square(colour.rise - colour.predicted)[mine].mean())
    typical = np.nanmedian(misfits, axis=0)
    return np.asarray(np.nan_to_num(1 / (1 + misfits / typical)))


def _trained_groups() -> list[int]:
    return [g for g in range(GROUPS) if g not in HELD_OUT]


def rises_at(table: NDArray[np.floating], places: FloatLine, distance_px: FloatLine) -> FloatGrid:
    """Return (n, k): rises behind each blob at some distances, linear between places.

    Args:
        table: (place, k).
        places: (place,) evenly spaced.
        distance_px: (n,).
    """
    at = (distance_px - places[0]) / (places[1] - places[0])
    low = np.clip(np.floor(at).astype(np.intp), 0, places.size - 2)
    share = np.clip(at - low, 0, 1)[:, None]
    return np.asarray((1 - share) * table[low] + share * table[low + 1], dtype=np.float64)


def first_spreads(edges: Sequence[PhotoEdge], reach_px: float) -> FloatGrid:
    """Return (edge, 2): standard deviations of Gaussians that explain the halves of edges."""
    places = fine_places(reach_px)
    spreads = []
    for edge in edges:
        spread, shift = reach_px / 5, 0.0
        widths = np.ones(2)
        for _ in range(_WIDTH_ROUNDS):
            profile = special.ndtr(places / spread)
            profiles = np.stack([profile] * len(edge.colours))
            shift = fit_edge_place(edge, profiles, places, start_px=shift).moved_px
            widths = width_factors(edge, profile, places, shift)
            change = float(np.nanmean(widths))
            if not np.isfinite(change):
                break
            widths = widths * spread
            spread = float(np.clip(spread * change, 0.3, reach_px))
        spreads.append(widths)
    return np.array(spreads)

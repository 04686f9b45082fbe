"""Weights of blobs, none negative, from the edges of all places of the field together.

Between two heights kernels are linear, as in a frozen PSF. Least squares with two penalties: light
is smooth within a kernel, and changes little from one height to the next. How strong they are is
decided by edges that were left out.

References: Cho 2011 (kernels from the profiles of edges, as projections); Schuler 2012 (the
symmetries of lenses in blind correction).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import linalg, optimize

from camkit.calibration.blur.blob_basis import Blobs, FloatGrid, FloatLine

SMOOTHNESS: Final = (1e-6, 1e-4, 1e-2)
"""Penalties on rough kernels that are tried, relative to what the edges say."""
ALIKE: Final = 3e-3
"""Penalty on the difference of neighbouring heights, likewise."""
_SUM: Final = 1.0
_MIDDLE: Final = 1.0
_MOST_STEPS: Final = 10
_STEADY: Final = 1e-12


@dataclass(slots=True, kw_only=True, eq=False)
class EdgeSums:
    """Normal equations of the edges of a group and colour.

    Attributes:
        same: (node, k, k) of each height with itself.
        next: (node - 1, k, k) of each height with the next one.
        right: (node, k).
        square: Of what is to be explained.
        weight: Of all samples.
    """

    same: FloatGrid
    next: FloatGrid
    right: FloatGrid
    square: float = 0.0
    weight: float = 0.0

    @classmethod
    def empty(cls, nodes: int, count: int) -> "EdgeSums":
        """Return sums of no edge."""
        return cls(
            same=np.zeros((nodes, count, count)),
            next=np.zeros((max(nodes - 1, 0), count, count)),
            right=np.zeros((nodes, count)),
        )

    def add(self, rises: FloatGrid, rise: FloatLine, weight: FloatLine, share: FloatLine) -> None:
        """Add the samples of an edge.

        Args:
            rises: (n, k) light behind each blob.
            rise: (n,) as seen.
            weight: (n,) of each.
            share: (node,) of each height in the edge, of two neighbours at most.
        """
        of_weight = rises * weight[:, None]
        table, right = of_weight.T @ rises, of_weight.T @ rise
        nodes = np.flatnonzero(share)
        for n in nodes:
            self.same[n] += share[n] ** 2 * table
            self.right[n] += share[n] * right
        if nodes.size == 2:
            self.next[nodes[0]] += share[nodes[0]] * share[nodes[1]] * table
        self.square += float(weight @ rise**2)
        self.weight += float(weight.sum())

    def plus(self, other: "EdgeSums", sign: float = 1.0) -> "EdgeSums":
        """Return the sum, or the difference."""
        return EdgeSums(
            same=self.same + sign * other.same,
            next=self.next + sign * other.next,
            right=self.right + sign * other.right,
            square=self.square + sign * other.square,
            weight=self.weight + sign * other.weight,
        )

    def misfit(self, weights: FloatGrid) -> float:
        """Return the weighted mean square that weights (node, k) leave."""
        same = np.einsum("nk,nkl,nl->", weights, self.same, weights, optimize=True)
        cross = np.einsum("nk,nkl,nl->", weights[:-1], self.next, weights[1:], optimize=True)
        rest = same + 2 * cross - 2 * float((self.right * weights).sum()) + self.square
        return float(rest / max(self.weight, 1e-12))

    def table(self) -> FloatGrid:
        """Return (node k, node k): all of it as one matrix."""
        nodes, count = self.right.shape
        whole = np.zeros((nodes, count, nodes, count))
        for n in range(nodes):
            whole[n, :, n] = self.same[n]
        for n in range(nodes - 1):
            whole[n, :, n + 1] = self.next[n]
            whole[n + 1, :, n] = self.next[n].T
        return whole.reshape(nodes * count, nodes * count)


def solve_weights(
    sums: EdgeSums,
    blobs: Blobs,
    smoothness: float,
    *,
    is_reference: bool,
    is_round: bool,
) -> FloatGrid:
    """Return the weights (node, k) of blobs, each kernel of sum 1.

    Args:
        sums: Of the edges.
        blobs: Their places.
        smoothness: Strength of the penalty.
        is_reference: Whether the kernels lie around their middle: one colour's must.
        is_round: Whether the first height is on the axis, where kernels are round.
    """
    nodes, count = sums.right.shape
    table = sums.table() / max(sums.weight, 1e-12)
    right = sums.right.ravel() / max(sums.weight, 1e-12)
    penalty = smoothness * _rough(blobs)
    diagonal = np.arange(nodes)
    blocks = table.reshape(nodes, count, nodes, count)
    penalty += _SUM
    if is_reference:
        penalty += _MIDDLE * np.outer(blobs.u_px, blobs.u_px)
    blocks[diagonal, :, diagonal] += penalty
    right = right + _SUM
    multiple = np.where(blobs.v_px > 0, 2.0, 1.0) * (blobs.spread_px / blobs.spread_px.min()) ** 2
    alike = np.diag(ALIKE / multiple)
    for n in range(nodes - 1):
        blocks[n, :, n] += alike
        blocks[n + 1, :, n + 1] += alike
        blocks[n, :, n + 1] -= alike
        blocks[n + 1, :, n] -= alike
    basis = _round_basis(blobs, nodes) if is_round else None
    if basis is not None:
        table, right = basis.T @ table @ basis, basis.T @ right
    steady = table + _STEADY * np.trace(table) / len(table) * np.eye(len(table))
    root = linalg.cholesky(steady, lower=True)
    weights, _ = optimize.nnls(
        root.T, linalg.solve_triangular(root, right, lower=True), maxiter=_MOST_STEPS * right.size
    )
    if basis is not None:
        weights = basis @ weights
    weights = weights.reshape(nodes, count)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _rough(blobs: Blobs) -> FloatGrid:
    """Return (k, k): the penalty on differences of neighbours."""
    one, other = blobs.pairs.T
    density = np.where(blobs.v_px > 0, 0.5, 1.0)
    rows = np.zeros((len(blobs.pairs), blobs.count))
    at = np.arange(len(rows))
    rows[at, one] = density[one]
    inner = one != other
    rows[at[inner], other[inner]] = -density[other[inner]]
    return np.asarray(rows.T @ (rows * blobs.stiffness[:, None]))


def _round_basis(blobs: Blobs, nodes: int) -> FloatGrid:
    """Return the matrix that makes round kernels of the first height out of rings."""
    rings = blobs.rings()
    rest = (nodes - 1) * blobs.count
    basis = np.zeros((blobs.count + rest, rings.shape[1] + rest))
    basis[: blobs.count, : rings.shape[1]] = rings
    basis[blobs.count :, rings.shape[1] :] = np.eye(rest)
    return basis

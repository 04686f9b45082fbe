"""Edges that kernels were not fitted to, as the kernels predict them, beside a plain Gaussian."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from camkit.calibration.blur.blob_basis import FloatGrid
from camkit.calibration.blur.edge_fit import (
    ColourFit,
    fine_places,
    fine_rises,
    fit_edge_place,
)
from camkit.calibration.blur.photo_blur import HELD_OUT, BlurModel, first_spreads
from camkit.calibration.blur.photo_edges import PhotoEdge


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """The misfit of held-out edges: medians of their root mean squares.

    Attributes:
        edges: How many they are.
        percent: Of the step.
        in_noise: In standard deviations of the noise.
        gaussian_percent: The same by a round Gaussian for each colour and height.
        gaussian_in_noise: Likewise; each colour of an edge may lie elsewhere.
    """

    edges: int
    percent: float
    in_noise: float
    gaussian_percent: float
    gaussian_in_noise: float

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "edges": self.edges,
            "percent": float(f"{self.percent:.3g}"),
            "in_noise": float(f"{self.in_noise:.3g}"),
            "gaussian_percent": float(f"{self.gaussian_percent:.3g}"),
            "gaussian_in_noise": float(f"{self.gaussian_in_noise:.3g}"),
        }


class _Misfits:
    """Root mean squares of edges, one by one."""

    def __init__(self) -> None:
        self.percent: list[float] = []
        self.in_noise: list[float] = []

    def add(self, colours: Sequence[ColourFit | None], sharp_half: NDArray[np.bool_]) -> None:
        """Add an edge: the mean of its colours."""
        squares = []
        for colour in colours:
            if colour is not None:
                mine = sharp_half[colour.half]
                rest = (colour.rise - colour.predicted)[mine]
                noise = np.maximum(colour.noise[mine], 1e-6)
                squares.append((np.square(rest).mean(), np.square(rest / noise).mean()))
        if squares:
            percent, in_noise = np.sqrt(np.mean(squares, axis=0))
            self.percent.append(100 * float(percent))
            self.in_noise.append(float(in_noise))

    @property
    def medians(self) -> tuple[float, float]:
        """Return those of percent and of noise."""
        return float(np.median(self.percent)), float(np.median(self.in_noise))


def judge_held_out(
    edges: Sequence[PhotoEdge],
    group: NDArray[np.intp],
    model: BlurModel,
    reach_px: float,
) -> HeldOut:
    """Compare held-out edges with what kernels predict of them.

    Only the sharp halves count: softness of the scene is not the lens's.

    Args:
        edges: All edges.
        group: (edge,) their groups.
        model: Fitted to the others.
        reach_px: To both sides of an edge.
    """
    spreads = gaussian_spreads(edges, group, model, reach_px)
    places = fine_places(reach_px)
    by_kernels, by_gaussian = _Misfits(), _Misfits()
    judged = 0
    for i in np.flatnonzero(np.isin(group, HELD_OUT) & model.sharp_half.any(axis=1)).tolist():
        edge, judged = edges[i], judged + 1
        mixed = np.einsum("n,cnk->ck", model.shares[i], model.weights)
        profiles = mixed @ fine_rises(model.blobs, edge, reach_px).T
        by_kernels.add(fit_edge_place(edge, profiles, places).colours, model.sharp_half[i])
        alone_fits: list[ColourFit | None] = []
        for c, rows in enumerate(edge.colours):
            if rows is not None:
                spread = float(model.shares[i] @ spreads[c])
                profile = special.ndtr(places / spread)[None]
                alone = replace(edge, colours=(rows,))
                alone_fits += fit_edge_place(alone, profile, places).colours
        by_gaussian.add(alone_fits, model.sharp_half[i])
    percent, in_noise = by_kernels.medians
    gaussian_percent, gaussian_in_noise = by_gaussian.medians
    return HeldOut(
        edges=judged,
        percent=percent,
        in_noise=in_noise,
        gaussian_percent=gaussian_percent,
        gaussian_in_noise=gaussian_in_noise,
    )


def gaussian_spreads(
    edges: Sequence[PhotoEdge], group: NDArray[np.intp], model: BlurModel, reach_px: float
) -> FloatGrid:
    """Return (c, node): round Gaussians of the sharp edges that are not held out."""
    fitted = np.flatnonzero(~np.isin(group, HELD_OUT) & model.sharp_half.any(axis=1)).tolist()
    spreads = []
    for c in range(model.weights.shape[0]):
        mine = [i for i in fitted if edges[i].colours[c] is not None]
        alone = [replace(edges[i], colours=(edges[i].colours[c],)) for i in mine]
        widths = np.nanmean(first_spreads(alone, reach_px), axis=1)
        shares = model.shares[mine]
        every = float(np.nanmedian(widths))
        spreads.append(
            [
                float(np.nanmedian(widths[of_node > 0.5])) if (of_node > 0.5).any() else every
                for of_node in shares.T
            ]
        )
    return np.array(spreads)

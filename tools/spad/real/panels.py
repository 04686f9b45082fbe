"""Pictures side by side in one PNG."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHOWN = (2.0, 98.0)
"""Percentiles between which colours run where nothing else is said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One picture.

    Attributes:
        title: Over it.
        values: (h, w); NaN is left white.
        span: Values of the first and the last colour; None for those of the picture.
        colors: Name of the colour map.
    """

    title: str
    values: NDArray[Any]
    span: tuple[float, float] | None = None
    colors: str = "turbo"


def write_panels(path: Path, panels: Sequence[Panel], *, columns: int = 4) -> None:
    """Write them, row after row."""
    from matplotlib.figure import Figure

    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(3.6 * columns, 3.5 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axis, panel in zip(axes, panels, strict=False):
        values = np.asarray(panel.values, float)
        known = values[np.isfinite(values)]
        low, high = panel.span or (np.percentile(known, SHOWN) if known.size else (0, 1))
        shown = axis.imshow(values, vmin=low, vmax=high, cmap=panel.colors)
        axis.set_title(panel.title, fontsize=9)
        axis.set_axis_off()
        figure.colorbar(shown, ax=axis, fraction=0.046)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    figure.savefig(path, dpi=80)

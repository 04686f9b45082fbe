"""One picture per scenario: PSNR of every method over the knob, chi^2 below, breaks marked."""

import textwrap
import warnings
from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.report.figure import Figure, Panel, chart, new_figure
from camkit.report.stress.break_point import Break, Grid
from camkit.report.stress.consistency import LIMIT
from camkit.report.stress.curve import Curve
from camkit.report.stress.rig import EARLIER_MARK

ROW_IN: Final = 1.7
LABEL_LETTERS: Final = 18
RIVAL_COLOURS: Final = ("#888888", "#d08a00", "#8a6d3b")
JUDGED_COLOURS: Final = ("#5aa9e6", "#1f4e9c", "#7b2d8b", "#2a9d5c")
"""In the order of the methods; one beside it, of another bundle, has the colour of its namesake."""


@chart
def draw_curve(curve: Curve, breaks: Sequence[Break]) -> Figure:
    """Draw a scenario.

    The band is the standard error over the scenes of what sets a method apart: how hard a scene
    is for all methods alike is taken out (Cousineau 2005).
    """
    rows = [(curve.psnr_db, "PSNR (dB)"), (curve.chi2, "chi² per pixel")]
    rows = [row for row in rows if any(np.isfinite(g).any() for g in row[0].values())]
    rows += [(grids, name.replace("_", " ")) for name, grids in curve.extra.items()]
    figure = new_figure(6.4, max(4.6, ROW_IN * len(rows)))
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (grids, label) in zip(axes, rows, strict=True):
        common = _common(list(grids.values()))
        for method, grid in grids.items():
            _line(axis, curve, method, (grid, common))
        axis.set_ylabel(textwrap.fill(label, LABEL_LETTERS))
        for break_point in breaks:
            if break_point.point is not None and EARLIER_MARK not in break_point.method:
                place = _position(curve, break_point.point)
                axis.axvline(place, color=_colour(curve, break_point.method), lw=1, ls=":")
    if len(rows) > 1 and rows[1][0] is curve.chi2:
        axes[1].axhline(LIMIT, color="#b00020", lw=0.8)
        axes[1].set_yscale("log")
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=len(names))
    _ticks(axes[-1], curve)
    return figure


def _common(grids: Sequence[Grid]) -> Grid:
    """Return how far each scene lies from the others in the mean over the methods."""
    finite = np.stack([np.where(np.isfinite(grid), grid, np.nan) for grid in grids])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # nothing is known: stays NaN
        scenes = np.nanmean(finite, axis=0)
        return np.asarray(np.nan_to_num(scenes - np.nanmean(scenes, axis=1, keepdims=True)))


def _line(axis: Panel, curve: Curve, method: str, grids: tuple[Grid, Grid]) -> None:
    grid, common = grids
    finite = np.isfinite(grid).any(axis=1)
    if not finite.any():
        return
    x = np.arange(len(curve.values))[finite]
    rows = [row[np.isfinite(row)] for row in grid[finite]]
    mean = np.array([row.mean() for row in rows])
    deviations = [row[np.isfinite(row)] for row in (grid - common)[finite]]
    error = np.array([row.std() / np.sqrt(row.size) for row in deviations])
    dashed = EARLIER_MARK in method
    colour = _colour(curve, method)
    axis.plot(x, mean, "o--" if dashed else "o-", ms=3, lw=1.4, color=colour, label=method)
    axis.fill_between(x, mean - error, mean + error, color=colour, alpha=0.12, lw=0)


def _colour(curve: Curve, method: str) -> str:
    """Return the colour of a method."""
    namesake = method.removesuffix(f" {EARLIER_MARK}")
    for names, colours in ((curve.rivals, RIVAL_COLOURS), (curve.judged, JUDGED_COLOURS)):
        if namesake in names:
            return colours[names.index(namesake) % len(colours)]
    return JUDGED_COLOURS[-1]


def _position(curve: Curve, value: float) -> float:
    """Return where a value lies between the evenly spaced values."""
    return float(np.interp(value, np.array(curve.values), np.arange(len(curve.values))))


def _ticks(axis: Panel, curve: Curve) -> None:
    labels = [curve.label(v) if curve.scenario.labels else f"{v:g}" for v in curve.values]
    turn = 25 if curve.scenario.labels else 0
    axis.set_xticks(range(len(curve.values)), labels, rotation=turn)
    axis.set_xlabel(f"{curve.scenario.knob} ({curve.scenario.unit})".replace(" ()", ""))

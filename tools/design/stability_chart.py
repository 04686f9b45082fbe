"""Stability of design for people: success, rays and quality against how far off a start was."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from camkit.report.figure import GRID_COLOR, MARKS, field_color, new_figure, to_png, to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

_CONFIDENT: Final = 1.959963984540054
_KEPT_LIMITS: Final = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What became of one start.

    Attributes:
        arm: How it was designed.
        number: Of the start.
        level: How far off it was: share of the curvatures.
        run: `box` for the short run of every start, `end` for those that went on.
        scaled: The lens.
        front_db: PSNR of the Wiener front on fresh pictures; NaN for a lens without image.
        valid_rays: Share of rays that reach the sensor.
        efl_mm: Its focal length.
        limits_cost: Sum of squares of the limits it breaks.
        cpu_s: What the design took.
    """

    arm: str
    number: int
    level: float
    run: str
    scaled: tuple[float, ...]
    front_db: float
    valid_rays: float
    efl_mm: float
    limits_cost: float
    cpu_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """What counts as a success, besides that no ray is lost.

    Attributes:
        efl_mm: The wanted focal length.
        within_db: Of the best short run of all arms.
        within_mm: Of the focal length.
    """

    efl_mm: float
    within_db: float = 0.5
    within_mm: float = 0.5

    def sound(self, trial: Trial) -> bool:
        """Return whether a lens loses no ray and has the wanted focal length."""
        off_mm = abs(trial.efl_mm - self.efl_mm)
        return math.isfinite(trial.front_db) and trial.valid_rays == 1 and off_mm <= self.within_mm


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """All short runs of an arm at a level.

    Attributes:
        arm: Which.
        level: Which.
        starts: How many.
        sharp: How many lose no ray and recover as well as a success, whatever their focal length.
        succeeded: How many succeeded.
        buildable: How many succeeded and keep the limits of the recipe.
        valid_rays: Of each start.
        front_db: Of each start that has an image.
    """

    arm: str
    level: float
    starts: int
    sharp: int
    succeeded: int
    buildable: int
    valid_rays: tuple[float, ...]
    front_db: tuple[float, ...]


def wilson_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return the 95 % interval of a share seen in so many trials.

    References: Wilson 1927, the score interval.
    """
    share, square = hits / trials, _CONFIDENT**2
    middle = (share + square / 2 / trials) / (1 + square / trials)
    half = (
        math.sqrt(share * (1 - share) / trials + square / 4 / trials**2)
        * _CONFIDENT
        / (1 + square / trials)
    )
    return max(0.0, middle - half), min(1.0, middle + half)


def best_trials(trials: Sequence[Trial], rules: Rules, arm: str, count: int) -> list[Trial]:
    """Return the best short runs of an arm; those that are no sound lens come last."""
    own = [t for t in trials if t.arm == arm and t.run == "box" and math.isfinite(t.front_db)]
    return sorted(own, key=lambda t: (not rules.sound(t), -t.front_db))[:count]


def cells(trials: Sequence[Trial], rules: Rules) -> list[Cell]:
    """Sum up short runs by arm and level."""
    short = [t for t in trials if t.run == "box"]
    best_db = max((t.front_db for t in short if rules.sound(t)), default=math.inf)
    made = []
    for arm in dict.fromkeys(t.arm for t in short):
        for level in sorted({t.level for t in short}):
            own = [t for t in short if (t.arm, t.level) == (arm, level)]
            level_db = best_db - rules.within_db
            sharp = [t for t in own if t.valid_rays == 1 and t.front_db >= level_db]
            good = [t for t in sharp if rules.sound(t)]
            made.append(
                Cell(
                    arm=arm,
                    level=level,
                    starts=len(own),
                    sharp=len(sharp),
                    succeeded=len(good),
                    buildable=sum(t.limits_cost < _KEPT_LIMITS for t in good),
                    valid_rays=tuple(t.valid_rays for t in own),
                    front_db=tuple(t.front_db for t in own if math.isfinite(t.front_db)),
                )
            )
    return [cell for cell in made if cell.starts]


def write_stability(
    trials: Sequence[Trial], rules: Rules, facts: Mapping[str, Any], folder: Path
) -> tuple[Path, ...]:
    """Write stability.png, .svg and .json; give the files."""
    found = cells(trials, rules)
    figure = draw_stability(found)
    png, svg, text = (folder / f"stability{ending}" for ending in (".png", ".svg", ".json"))
    png.write_bytes(to_png(figure))
    svg.write_text(to_svg(figure), encoding="utf-8")
    report = {**facts, "cells": [_row(c) for c in found], "ends": [_end(t) for t in _ends(trials)]}
    text.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return png, svg, text


def _ends(trials: Sequence[Trial]) -> list[Trial]:
    return [t for t in trials if t.run == "end"]


def _row(cell: Cell) -> dict[str, Any]:
    return {
        "arm": cell.arm,
        "curvature_percent": 100 * cell.level,
        "starts": cell.starts,
        "sharp": cell.sharp,
        "succeeded": cell.succeeded,
        "interval_95": wilson_interval(cell.succeeded, cell.starts),
        "buildable": cell.buildable,
        "valid_rays_mean": float(np.mean(cell.valid_rays)),
        "valid_rays_least": min(cell.valid_rays),
        "front_db_median": float(np.median(cell.front_db)) if cell.front_db else None,
        "front_db": sorted(cell.front_db),
    }


def _end(trial: Trial) -> dict[str, Any]:
    return {
        "arm": trial.arm,
        "start": trial.number,
        "front_db": trial.front_db if math.isfinite(trial.front_db) else None,
        "valid_rays": trial.valid_rays,
        "efl_mm": trial.efl_mm,
        "limits_cost": trial.limits_cost,
    }


def to_text(trials: Sequence[Trial], rules: Rules) -> str:
    """Return the table as Markdown."""
    lines = [
        "| arm | curvatures | sharp | success (95 %) | inside limits | valid rays | median dB |",
        "|---|---|---|---|---|---|---|",
    ]
    for cell in cells(trials, rules):
        low, high = wilson_interval(cell.succeeded, cell.starts)
        middle = f"{np.median(cell.front_db):.2f}" if cell.front_db else "-"
        lines.append(
            f"| {cell.arm} | ± {100 * cell.level:.0f} % | {cell.sharp}/{cell.starts} | "
            f"{cell.succeeded}/{cell.starts} "
            f"({100 * low:.0f}-{100 * high:.0f} %) | {cell.buildable}/{cell.starts} | "
            f"{np.mean(cell.valid_rays):.3f} | {middle} |"
        )
    lines += [
        f"to the end: {trial.arm}, start {trial.number}: {trial.front_db:.2f} dB, EFL "
        f"{trial.efl_mm:.2f} mm, valid rays {trial.valid_rays:.3f}"
        for trial in _ends(trials)
    ]
    return "\n".join(lines)


def draw_stability(found: Sequence[Cell]) -> "Figure":
    """Draw success with its interval, valid rays and quality over the levels."""
    figure = new_figure(11, 3.7)
    success, rays, quality = figure.subplots(1, 3)
    levels = sorted({cell.level for cell in found})
    arms = list(dict.fromkeys(cell.arm for cell in found))
    for number, arm in enumerate(arms):
        own = [cell for cell in found if cell.arm == arm]
        # side by side, so that intervals do not hide each other
        shift = 0.12 * (number - (len(arms) - 1) / 2)
        places = [levels.index(cell.level) + shift for cell in own]
        color, mark = field_color(number), MARKS[number]
        _draw_success(success, own, places, color=color, mark=mark)
        for panel, values in (
            (rays, [cell.valid_rays for cell in own]),
            (quality, [cell.front_db for cell in own]),
        ):
            for place, each in zip(places, values, strict=True):
                panel.plot([place] * len(each), each, mark, color=color, markersize=4)
    success.legend(fontsize=8, frameon=False)
    rays.set_ylim(min(0.9, *(min(cell.valid_rays) - 0.02 for cell in found)), 1.01)
    titles = ("success, 95 % interval", "share of rays that arrive", "PSNR, Wiener, dB")
    for panel, title in zip((success, rays, quality), titles, strict=True):
        panel.set_title(title, fontsize=9)
        panel.set_xticks(range(len(levels)), [f"± {100 * level:.0f} %" for level in levels])
        panel.set_xlabel("curvatures of the start off by")
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    return figure


def _draw_success(
    panel: "Panel", own: Sequence[Cell], places: Sequence[float], *, color: str, mark: str
) -> None:
    shares = [cell.succeeded / cell.starts for cell in own]
    bounds = [wilson_interval(cell.succeeded, cell.starts) for cell in own]
    reach = [
        [max(0.0, share - low) for share, (low, _) in zip(shares, bounds, strict=True)],
        [max(0.0, high - share) for share, (_, high) in zip(shares, bounds, strict=True)],
    ]
    panel.errorbar(places, shares, yerr=reach, fmt=mark, color=color, capsize=3, label=own[0].arm)
    panel.set_ylim(-0.02, 1.02)

"""The page of a stress run: summary, curves, worst patches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.bundle.manifest import Range
from camkit.report.figure import encode_png, levels_of
from camkit.report.pages.page import Cell, Page, Part, Picture, Section, Table, Words
from camkit.report.stress.break_point import CHI2, TIE_DB, Break, sound_values
from camkit.report.stress.consistency import LIMIT
from camkit.report.stress.curve import Curve, margins
from camkit.report.stress.score import PATCH_PX
from camkit.report.stress.verdict import Examiner, SweptScene
from camkit.runtime.envelope import QUANTITIES

ENLARGED: Final = 2
REASONS: Final = {CHI2: "the capture is not explained: chi²", "fault": "something that cannot be"}
"""Rules of `Break.reason` that are not words yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Patches:
    """Pictures of one place.

    Attributes:
        place: Where, in words.
        pictures: "sharp" and every method -> PNG.
    """

    place: str
    pictures: dict[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class Swept:
    """One scenario on the page.

    Attributes:
        curve: What was measured.
        breaks: Of all judged methods.
        chart: PNG.
        patches: The worst place; None if there is none.
    """

    curve: Curve
    breaks: tuple[Break, ...]
    chart: bytes
    patches: Patches | None


def stress_page(
    title: str,
    facts: Mapping[str, str],
    swept: Sequence[Swept],
    *,
    skipped: Mapping[str, str],
    envelope: Mapping[str, Range],
) -> Page:
    """Return the page.

    Args:
        title: Heading.
        facts: What was run, name -> value.
        swept: The scenarios.
        skipped: Scenario -> why it was left out.
        envelope: The measured ranges.
    """
    rule = (
        f"A method breaks where, in the mean over the scenes, it is more than {TIE_DB} dB worse "
        f"than {_rivals(swept)}, where its chi² per pixel exceeds {LIMIT} (1 on an undisturbed "
        "capture), or where it gives something that cannot be: NaN, a seam, contrast that is not "
        "in the scene. In brackets: 95 % confidence over the scenes; ∞ is beyond the tested range."
    )
    rows = [(name, Cell(text=value, look="words")) for name, value in facts.items()]
    left_out = [Words(f"{name} was left out: {why}.", "note") for name, why in skipped.items()]
    sections = [_ranges(envelope)] if envelope else []
    return Page(
        title=title,
        lead=[Table(rows=rows), rule, _summary(swept), *left_out],
        sections=[*sections, *map(_section, swept)],
    )


def _rivals(swept: Sequence[Swept]) -> str:
    """Return the methods that the others must not fall behind."""
    names = dict.fromkeys(name for one in swept for name in one.curve.rivals)
    return " or ".join(names) or "nothing else"


def _summary(swept: Sequence[Swept]) -> Table:
    rows = []
    for one in swept:
        scenario = one.curve.scenario
        for method in one.curve.judged:
            mine = [b for b in one.breaks if b.method == method]
            words = "; ".join(describe_break(one.curve, b) for b in mine)
            broken = any(b.point is not None for b in mine)
            link = Cell(text=scenario.title, anchor=scenario.name)
            rows.append((link, method, Cell(text=words, look="bad" if broken else "")))
    return Table(header=("scenario", "method", "breaks"), rows=rows)


def describe_break(curve: Curve, break_point: Break) -> str:
    """Describe where a method breaks on one side."""
    side = "below" if break_point.side == "down" else "above"
    if break_point.point is None:
        return f"sound to {curve.label(curve.values[0 if break_point.side == 'down' else -1])}"
    reason = REASONS.get(break_point.reason, break_point.reason)
    if curve.scenario.labels:
        return f"at {curve.label(break_point.point)} ({reason})"
    unit = f" {curve.scenario.unit}".rstrip()
    low, high = ("∞" if end is None else f"{end:.3g}" for end in break_point.ci)
    return f"{side} {break_point.point:.3g}{unit} [{low} to {high}] ({reason})"


def _ranges(envelope: Mapping[str, Range]) -> Section:
    rows = [
        (name, QUANTITIES.get(name, ""), f"{r.low:.4g}", f"{r.high:.4g}")
        for name, r in envelope.items()
    ]
    table = Table(header=("name", "", "from", "to"), rows=rows)
    return Section("Measured ranges (envelope)", (table,))


def _section(swept: Swept) -> Section:
    scenario = swept.curve.scenario
    parts: list[Part] = [Words(scenario.note, "small")] if scenario.note else []
    parts.append(Picture("", swept.chart))
    if swept.patches is not None:
        place = swept.patches.place
        parts.append(f"Where it fails most against {_rivals([swept])}: {place}:")
        parts += [Picture(name, png, is_patch=True) for name, png in swept.patches.pictures.items()]
    return Section(scenario.title, parts, scenario.name)


def worst_patches(
    curve: Curve, judge: Examiner, scenes: tuple[SweptScene, ...], method: str
) -> Patches | None:
    """Repeat the worst capture of a scenario and cut the worst patch of it and every method.

    Args:
        curve: What was measured.
        judge: Restores and judges.
        scenes: Of the sweep.
        method: Whose worst patch.

    Returns:
        None if the scenario takes no photographs or the method gave nothing to compare.
    """
    at = worst_place(curve, method)
    if curve.scenario.shoot is None or at is None:
        return None
    value, name = curve.values[at[0]], curve.scenes[at[1]]
    scene = next((s for s in scenes if s.name == name), None)
    patch_px = curve.outcomes[at][method].patch_px
    if scene is None or patch_px is None:
        return None
    pictures = judge.pictures(curve.scenario.shoot(judge, scene, value))
    x, y = patch_px
    cut = np.s_[:, y : y + PATCH_PX, x : x + PATCH_PX]
    return Patches(
        place=f"{curve.label(value)}, {name}, x {x}, y {y}",
        pictures={m: encode_png(levels_of(p[cut], ENLARGED)) for m, p in pictures.items()},
    )


def worst_place(curve: Curve, method: str) -> tuple[int, int] | None:
    """Return (value index, scene index) of the capture to look at; None if nothing was compared.

    The value is the first broken one, else that of the least gain in PSNR over its rivals; the
    scene is that of the least gain.
    """
    if method not in curve.methods:
        return None
    plain = [curve.psnr_db[m] for m in curve.rivals if m in curve.psnr_db and m != method]
    grid = curve.psnr_db[method] - (np.fmax.reduce(plain) if plain else 0.0)
    finite = np.isfinite(grid)
    if not finite.any():
        return None
    broken = np.flatnonzero(~sound_values(margins(curve, method)) & finite.any(axis=1))
    if broken.size:
        row = int(min(broken, key=lambda i: abs(i - curve.nominal)))
    else:
        row = int(np.unravel_index(np.argmin(np.where(finite, grid, np.inf)), grid.shape)[0])
    return row, int(np.argmin(np.where(finite[row], grid[row], np.inf)))

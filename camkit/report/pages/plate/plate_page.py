"""The page of a plate, and its charts beside it."""

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Final

from camkit.models_def.optics.diffraction.plate_optics import REFERENCE_UM
from camkit.models_def.optics.diffraction.shares import CORE_PX, HALF_WIDTH_PX
from camkit.report.pages.page import Page, Part, Picture, Section, Table, Words, write_page
from camkit.report.pages.plate.plate_charts import draw_cuts, draw_heights, draw_psf
from camkit.report.pages.plate.plate_facts import WINDOW_SHARE, PlateFacts
from camkit.units import MM_PER_M

_CHARTS: Final = {"psf": draw_psf, "cuts": draw_cuts, "heights": draw_heights}
_CAPTIONS: Final = {
    "psf": "A point light in the colours of the sensor, flat spectrum; the light of a pixel over "
    "all light that the aperture lets through.",
    "cuts": f"Light within {HALF_WIDTH_PX:g} px of a line, both arms together; dotted: the bare "
    f"lens. Right: what lies farther from the middle; the line marks the core, {CORE_PX:g} px.",
    "heights": "As made: rounded to levels where the plate is etched.",
}
_SHARES: Final = (
    *("colour", "core, %", "bare", "streaks, %", "bare", "haze, %", "bare", "written, %"),
)
_MEANING: Final = (
    f"Core: within {CORE_PX:g} px of the middle. Streaks: within {HALF_WIDTH_PX:g} px of a line, "
    "beyond the core, as far as it reaches; the bare lens is counted in the same places. Haze: "
    "everything else, what left the window included. Written: what the streaks hold beyond the "
    "bare lens's light there, which sinks as its core does."
)


def write_plate_page(facts: PlateFacts, folder: Path, name: str) -> list[Path]:
    """Write NAME.html, and NAME-CHART.svg and .png beside it; return the files, the page first.

    Raises:
        UnsupportedError: If matplotlib is not installed.
    """
    charts = {chart: partial(draw, facts) for chart, draw in _CHARTS.items()}
    return write_page(folder, name, charts, partial(plate_page, facts))


def plate_page(facts: PlateFacts, pictures: Mapping[str, str]) -> Page:
    """Return the page.

    Args:
        facts: Of the plate.
        pictures: Name -> SVG text.
    """
    plate = facts.plate
    charts = {name: Picture(_CAPTIONS[name], svg) for name, svg in pictures.items()}
    light = (_shares(facts), _window_words(facts), Words(_MEANING, "small"))
    sections = [
        Section("Where the light goes", light),
        Section("Point spread function", (charts.get("psf"),)),
        Section("Along the streaks", (charts.get("cuts"),)),
        Section("Streaks", _streaks(facts)),
        Section("Relief", (charts.get("heights"),)),
        Section("Plate and bench", (_bench(facts),)),
    ]
    lead = (Words(plate.note, "small"),) if plate.note else ()
    return Page(title=plate.name, lead=lead, sections=sections)


def _shares(facts: PlateFacts) -> Table:
    rows = []
    for channel, with_plate, bare in zip(
        facts.channels, facts.of_colour, facts.of_bare, strict=True
    ):
        parts = ("core", "streak", "haze")
        shares = [getattr(one, part) for part in parts for one in (with_plate, bare)]
        streak_gain = with_plate.streak - bare.streak * with_plate.core / bare.core
        rows.append((channel, *(f"{100 * share:.2f}" for share in (*shares, streak_gain))))
    return Table(header=_SHARES, rows=rows)


def _window_words(facts: PlateFacts) -> str:
    statement = (
        f"{facts.psf_side_px} px hold {100 * WINDOW_SHARE:g} % of the light of every colour."
        if facts.psf_side_px < facts.psf.shape[-1]
        else f"The window of {facts.psf_side_px} px holds less than {100 * WINDOW_SHARE:g} % of "
        "the light of a colour."
    )
    return (
        f"Strehl ratio at {REFERENCE_UM:g} µm: {facts.strehl:.3f}; of the bare lens "
        f"{facts.bare_strehl:.3f}. {statement}"
    )


def _streaks(facts: PlateFacts) -> list[Part]:
    if not facts.streaks:
        return ["None."]
    rows = [(f"{one.angle_deg:.1f}°", f"{one.reach_px:.0f}") for one in facts.streaks]
    return [
        Table(header=(f"angle at {REFERENCE_UM:g} µm", "reach, px"), rows=rows),
        Words("From the right towards downwards; every line has two arms.", "small"),
    ]


def _bench(facts: PlateFacts) -> Table:
    plate, bench = facts.plate, facts.plate.bench
    heights = plate.made_um
    rows = [
        ("glass", plate.glass),
        ("cells along a side", str(heights.shape[0])),
        ("cell, µm", f"{plate.cell_um:.4g}"),
        ("relief, peak to valley, µm", f"{float(heights.max() - heights.min()):.4g}"),
        ("aperture", f"{bench.aperture}, {bench.diameter_mm:g} mm"),
        ("focal length, mm", _number(bench.focal_length_mm)),
        ("in focus at, m", _number(bench.focus_mm / MM_PER_M)),
        ("point light at, m", _number(facts.depth_mm / MM_PER_M)),
        ("pixel, µm", f"{facts.pitch_um:g}"),
    ]
    if plate.etching is not None:
        etching = plate.etching
        wraps = ", wrapped" if etching.wraps else ""
        rows.append(("etched", f"{etching.levels} levels over {etching.range_um:g} µm{wraps}"))
    return Table(rows=rows)


def _number(value: float) -> str:
    return "∞" if math.isinf(value) else f"{value:g}"

"""The page of a plate; one file, no other needed."""

import math
import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Final

from camkit.models_def.optics.diffraction.plate_optics import REFERENCE_UM
from camkit.models_def.optics.diffraction.shares import CORE_PX, HALF_WIDTH_PX
from camkit.report.plate.facts import HELD, PlateFacts
from camkit.report.style import STYLE
from camkit.units import MM_PER_M

TITLES: Final = {
    "psf": "Point spread function",
    "cuts": "Along the streaks",
    "heights": "Relief",
}
_CAPTIONS: Final = {
    "psf": "A point light in the colours of the sensor, flat spectrum; the light of a pixel over "
    "all light that the aperture lets through.",
    "cuts": f"Light within {HALF_WIDTH_PX:g} px of a line, both arms together; dotted: the bare "
    f"lens. Right: what lies farther from the middle; the line marks the core, {CORE_PX:g} px.",
    "heights": "As made: rounded to levels where the plate is etched.",
}


def to_html(facts: PlateFacts, pictures: Mapping[str, str]) -> str:
    """Return the page.

    Args:
        facts: Of the plate.
        pictures: Name -> SVG text.
    """
    plate = facts.plate
    parts = [f"<h1>{escape(plate.name)}</h1>"]
    if plate.note:
        parts.append(f"<p class=small>{escape(plate.note)}</p>")
    parts += ["<h2>Where the light goes</h2>", _shares(facts), _notes(facts)]
    parts += [*_picture("psf", pictures), *_picture("cuts", pictures)]
    parts += ["<h2>Streaks</h2>", _streaks(facts)]
    parts += [*_picture("heights", pictures), "<h2>Plate and bench</h2>", _bench(facts)]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>camkit plate: {escape(plate.name)}</title><style>{STYLE}</style></head>\n<body>"
        + "\n".join(parts)
        + "</body></html>\n"
    )


def _picture(name: str, pictures: Mapping[str, str]) -> list[str]:
    if name not in pictures:
        return []
    # ids of several pictures in one page must differ
    svg = pictures[name][pictures[name].index("<svg") :]
    svg = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    return [f"<h2>{TITLES[name]}</h2>", svg, f"<p class=small>{escape(_CAPTIONS[name])}</p>"]


def _shares(facts: PlateFacts) -> str:
    rows = []
    for channel, with_plate, bare in zip(
        facts.channels, facts.of_colour, facts.of_bare, strict=True
    ):
        pairs = [
            (with_plate.core, bare.core),
            (with_plate.streak, bare.streak),
            (with_plate.haze, bare.haze),
        ]
        cells = [f"{100 * share:.2f}" for pair in pairs for share in pair]
        moved = with_plate.streak - bare.streak * with_plate.core / bare.core
        rows.append((channel, *cells, f"{100 * moved:.2f}"))
    head = ("colour", "core, %", "bare", "streaks, %", "bare", "haze, %", "bare", "written, %")
    return _table(head, rows)


def _notes(facts: PlateFacts) -> str:
    held = (
        f"{facts.psf_side_px} px hold {100 * HELD:g} % of the light of every colour."
        if facts.psf_side_px < facts.psf.shape[-1]
        else f"The window of {facts.psf_side_px} px holds less than {100 * HELD:g} % of the light "
        "of a colour."
    )
    return (
        f"<p>Strehl ratio at {REFERENCE_UM:g} µm: {facts.strehl:.3f}; of the bare lens "
        f"{facts.bare_strehl:.3f}. {held}</p><p class=small>Core: within {CORE_PX:g} px of the "
        f"middle. Streaks: within {HALF_WIDTH_PX:g} px of a line, beyond the core, as far as it "
        "reaches; the bare lens is counted in the same places. Haze: everything else, what left "
        "the window included. Written: what the streaks hold beyond the bare lens's light there, "
        "which sinks as its core does.</p>"
    )


def _streaks(facts: PlateFacts) -> str:
    if not facts.streaks:
        return "<p>None.</p>"
    rows = [(f"{one.angle_deg:.1f}°", f"{one.reach_px:.0f}") for one in facts.streaks]
    return _table((f"angle at {REFERENCE_UM:g} µm", "reach, px"), rows) + (
        "<p class=small>From the right towards downwards; every line has two arms.</p>"
    )


def _bench(facts: PlateFacts) -> str:
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
    return _table((), rows)


def _number(value: float) -> str:
    return "∞" if math.isinf(value) else f"{value:g}"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "<tr>" + "".join(f"<th>{escape(h)}</th>" for h in head) + "</tr>" if head else ""
    cells = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<div class=scroll><table>{top}{cells}</table></div>"

"""One HTML page of a stress run, complete in itself: summary, curves, worst patches."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from camkit.bundle.manifest import Range
from camkit.report.stress.break_point import CHI2, TIE_DB, Break
from camkit.report.stress.consistency import LIMIT
from camkit.report.stress.curve import Curve
from camkit.report.stress.patch import Patches
from camkit.runtime.envelope import QUANTITIES

STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em;
  color: #222; background: #fff }
table { border-collapse: collapse; margin: 1em 0 } td, th { padding: .25em .7em; text-align: left;
  border-bottom: 1px solid #ddd; vertical-align: top } th { background: #f4f4f4 }
td.broken { color: #b00020 } section { border-top: 2px solid #ddd; margin-top: 2em }
figure { display: inline-block; margin: 0 .5em .5em 0 } figcaption { font-size: 12px; color: #555 }
img { max-width: 100% } .note { color: #555 }
"""

REASONS: Final = {CHI2: "the capture is not explained: chi²", "fault": "something that cannot be"}
"""Rules of `Break.reason` that are not words yet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
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
    sections: Sequence[Section],
    *,
    skipped: Mapping[str, str],
    envelope: Mapping[str, Range],
) -> str:
    """Return the page.

    Args:
        title: Heading.
        facts: What was run, name -> value.
        sections: One per scenario.
        skipped: Scenario -> why it was left out.
        envelope: The measured ranges.
    """
    parts = [
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(title)}</title>",
        f"<style>{STYLE}</style><h1>{escape(title)}</h1>",
        _table(("", ""), [(escape(k), escape(v)) for k, v in facts.items()]),
        f"<p>A method breaks where, in the mean over the scenes, it is more than {TIE_DB} dB "
        f"worse than {_rivals(sections)}, where its chi&sup2; per pixel exceeds "
        f"{LIMIT} (1 on an undisturbed capture), or where it gives something that cannot be: NaN, "
        "a seam, contrast that is not in the scene. In brackets: 95 % confidence over the scenes; "
        "&infin; is beyond the tested range.</p>",
        _summary(sections),
        *(f"<p class=note>{escape(n)} was left out: {escape(r)}.</p>" for n, r in skipped.items()),
        _ranges(envelope),
        *(_section(section) for section in sections),
        "</html>\n",
    ]
    return "\n".join(parts)


def _rivals(sections: Sequence[Section]) -> str:
    """Name the methods that the others must not fall behind."""
    names = dict.fromkeys(name for section in sections for name in section.curve.rivals)
    return escape(" or ".join(names)) or "nothing else"


def _summary(sections: Sequence[Section]) -> str:
    rows = []
    for section in sections:
        scenario = section.curve.scenario
        link = f"<a href='#{scenario.name}'>{escape(scenario.title)}</a>"
        for method in section.curve.judged:
            mine = [b for b in section.breaks if b.method == method]
            words = "; ".join(describe_break(section.curve, b) for b in mine)
            broken = any(b.point is not None for b in mine)
            mark = f"<td class=broken>{escape(words)}" if broken else f"<td>{escape(words)}"
            rows.append(f"<tr><td>{link}<td>{escape(method)}{mark}")
            link = ""
    return "<table><tr><th>scenario<th>method<th>breaks" + "".join(rows) + "</table>"


def describe_break(curve: Curve, found: Break) -> str:
    """Say in words where a method breaks on one side."""
    side = "below" if found.side == "down" else "above"
    if found.point is None:
        ends = (curve.values[0], curve.values[-1])
        last = ends[0] if found.side == "down" else ends[1]
        return f"sound to {curve.label(last)}"
    reason = REASONS.get(found.reason, found.reason)
    if curve.scenario.labels:
        return f"at {curve.label(found.point)} ({reason})"
    unit = f" {curve.scenario.unit}".rstrip()
    low, high = ("∞" if end is None else f"{end:.3g}" for end in found.ci)
    return f"{side} {found.point:.3g}{unit} [{low} to {high}] ({reason})"


def _ranges(envelope: Mapping[str, Range]) -> str:
    if not envelope:
        return ""
    rows = [
        (escape(name), escape(QUANTITIES.get(name, "")), f"{r.low:.4g}", f"{r.high:.4g}")
        for name, r in envelope.items()
    ]
    return "<h2>Measured ranges (envelope)</h2>" + _table(("name", "", "from", "to"), rows)


def _section(section: Section) -> str:
    scenario = section.curve.scenario
    parts = [
        f"<section id='{scenario.name}'><h2>{escape(scenario.title)}</h2>",
        f"<p class=note>{escape(scenario.note)}</p>" if scenario.note else "",
        _image(section.chart, scenario.title),
    ]
    if section.patches is not None:
        patches = section.patches
        place = f"{section.curve.label(patches.value)}, {patches.scene}"
        parts.append(
            f"<p>Where it fails most against {_rivals([section])}: {escape(place)}, "
            f"x {patches.x_px}, y {patches.y_px}:</p>"
        )
        parts += [
            f"<figure>{_image(png, name)}<figcaption>{escape(name)}</figcaption></figure>"
            for name, png in patches.pictures.items()
        ]
    return "\n".join([*parts, "</section>"])


def _image(png: bytes, alt: str) -> str:
    data = base64.b64encode(png).decode()
    return f"<img alt='{escape(alt)}' src='data:image/png;base64,{data}'>"


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    top = "<tr>" + "".join(f"<th>{h}" for h in head) if any(head) else ""
    body = "".join("<tr>" + "".join(f"<td>{cell}" for cell in row) for row in rows)
    return f"<table>{top}{body}</table>"

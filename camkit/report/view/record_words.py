"""A sidecar in plain sentences and in tables."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.errors import CamkitError
from camkit.report.pages.page import Cell, Part, Row, Table, Words, sentences
from camkit.runtime.envelope import OPEN_HIGH, QUANTITIES

_SLOWEST: Final = 3
_SHORT_S: Final = 0.26
"""Up to which an exposure is a fraction, as on cameras: 0.4 s would be 1/2."""
_HIGHLIGHTS: Final = {
    "regions": "groups of clipped lights that were recovered: {:.0f}",
    "saturated_fraction": "{:.2%} of the samples were saturated",
    "unexplained": "{:.2%} of the streaks are not explained by the lights",
}


def record_sentences(record: Mapping[str, Any]) -> list[Part]:
    """Return what a sidecar says of its capture and of the work, as paragraphs."""
    return [
        sentences(_camera(record)),
        sentences(_work(record)),
        sentences(*_sections(record)),
        *(Words(f"Warning: {warning}.", "note") for warning in record.get("warnings", [])),
    ]


def record_lines(record: Mapping[str, Any]) -> list[str]:
    """Return what a sidecar says as lines of text: files, capture, work, warnings."""
    parts = [f"{record['input']} -> {record['output']}", *record_sentences(record)]
    texts = [part.text if isinstance(part, Words) else part for part in parts]
    return [text for text in texts if isinstance(text, str)]


def decision_table(record: Mapping[str, Any]) -> Table | None:
    """Return what was decided for a capture, and what was spared; None without decisions."""
    decisions = record.get("plan", {}).get("decisions")
    if not decisions:
        return None
    rows: list[Row] = [
        (
            one["what"],
            Cell(text=str(one["choice"]), look="words"),
            Cell(text=str(one["reason"]), look="words"),
            "-" if one["saving_s"] is None else f"{one['saving_s']:.2f}",
            f"{one['cost_db']:.3f}",
        )
        for one in decisions
    ]
    header = ("decision", "choice", "reason", "saves, s", "costs, dB")
    return Table(header=header, rows=rows)


def range_table(record: Mapping[str, Any]) -> Table | None:
    """Return what was measured of a capture beside the measured range of its bundle.

    None where nothing was measured. Without the very bundle the ranges are not known.
    """
    conditions = record.get("plan", {}).get("envelope", {}).get("seen")
    if not conditions:
        return None
    ranges = _ranges(record)
    rows: list[Row] = []
    for name, value in conditions.items():
        span = ranges.get(name)
        is_inside = span is None or span[0] <= value <= span[1]
        rows.append(
            (
                Cell(text=QUANTITIES.get(name, name), look="words"),
                f"{value:.4g}",
                "-" if span is None else _span_text(*span),
                Cell(text="-" if span is None else "yes" if is_inside else "no",
                     look="" if is_inside else "bad"),
            )
        )  # fmt: skip
    return Table(header=("quantity", "capture", "measured range", "inside"), rows=rows)


def key_table(record: Mapping[str, Any]) -> Table:
    """Return every key of a sidecar with its value."""
    rows = [(key, Cell(text=text, look="words")) for key, text in _flat(record, "")]
    return Table(header=("key", "value"), rows=rows)


def _span_text(low: float, high: float) -> str:
    return f"{low:.3g} or more" if high >= OPEN_HIGH else f"{low:.3g} to {high:.3g}"


def _ranges(record: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    name = record.get("bundle")
    if not name:
        return {}
    try:
        bundle = open_bundle(find_bundle(str(name)))
    except (CamkitError, OSError):
        return {}
    if bundle.sha256 != record["bundle_sha256"]:
        return {}
    envelope = bundle.manifest.envelope or {}
    return {key: (span.low, span.high) for key, span in envelope.items()}


def _camera(record: Mapping[str, Any]) -> str:
    parts = [f"The camera is {record['camera']}"] if record.get("camera") else []
    if record.get("iso") is not None:
        parts.append(f"ISO {record['iso']:g}")
    if exposure_s := record.get("exposure_time_s"):
        is_short = exposure_s <= _SHORT_S
        text = f"1/{1 / exposure_s:.0f}" if is_short else f"{exposure_s:.3g}"
        parts.append(f"exposure {text} s")
    lens = record.get("metadata", {}).get("lens_model") if record.get("metadata") else None
    parts += [f"lens {lens}"] if lens else []
    return ", ".join(parts)


def _work(record: Mapping[str, Any]) -> str:
    seconds = record["seconds"]
    way = "made without a bundle"
    if record.get("bundle"):
        size = record.get("size") or record.get("plan", {}).get("size")
        way = f"made with the bundle {record['bundle']}" + (
            f" and its network {size}" if size else ""
        )
    total = sum(seconds.values())
    slow = sorted(seconds.items(), key=lambda item: -item[1])[:_SLOWEST]
    slowest = ", ".join(f"{name} {value:.2f} s" for name, value in slow)
    left_out = [
        name
        for name, stage in record.get("plan", {}).get("stages", {}).items()
        if stage.get("way") == "left out"
    ]
    skipped = f" It left out: {', '.join(left_out)}." if left_out else ""
    return (
        f"The result was {way}, by camkit {record.get('camkit', '')}. It took {total:.2f} s, most "
        f"for {slowest}, and at most {record['peak_rss_mb']:.0f} MB of memory.{skipped}"
    )


def _sections(record: Mapping[str, Any]) -> list[str]:
    notes = []
    if record.get("clipped_fraction") is not None:
        notes.append(f"{record['clipped_fraction']:.2%} of the samples were clipped")
    envelope = record.get("plan", {}).get("envelope") or {}
    if envelope.get("outside") == []:
        notes.append("the capture lies inside the measured range of the bundle")
    highlights = record.get("hdr", {})
    notes += [
        text.format(highlights[key]) for key, text in _HIGHLIGHTS.items() if key in highlights
    ]
    if photons := record.get("spad", {}).get("photons"):
        notes.append(f"the sensor counted about {photons:,.0f} photons")
    if (valid := record.get("spad", {}).get("valid")) and record["spad"].get("pixels"):
        notes.append(f"{valid[0]} of {record['spad']['pixels']} pixels are valid")
    return notes


def _flat(value: Any, prefix: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for number, inner in enumerate(value):
            yield from _flat(inner, f"{prefix}[{number}]")
    elif isinstance(value, list):
        yield prefix, ", ".join(map(str, value)) or "none"
    else:
        yield prefix, "none" if value is None else str(value)

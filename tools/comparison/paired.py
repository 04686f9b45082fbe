"""Gains of one method over another on the same captures, with the error of their mean.

A picture is photographed at several places and ISOs, so its captures are not independent: the
error is that of the mean over pictures, each with its own mean over captures.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from tools.comparison.measurement import Measurement
from tools.comparison.names import CLASSICAL, EARLIER, TITLES, title_of
from tools.tables.records import markdown_table

OURS: Final = ("bank", "S", "M", "L")
CLASSIC: Final = "best classical"
AIMS_DB: Final = {
    ("bank", CLASSIC): 0.5,
    ("S", "M" + EARLIER): 0.0,
    ("M", "M" + EARLIER): 0.2,
    ("M", CLASSIC): 2.5,
}


def pairs_of(methods: Sequence[str], best_classical: str | None) -> list[tuple[str, str]]:
    """Return what is compared with what.

    Bank and networks with the same before, S with M before, bank and networks with the best
    classical method, M with rivals.
    """
    ours = [name for name in methods if name in OURS]
    pairs = [(name, name + EARLIER) for name in ours if name + EARLIER in methods]
    if "S" in methods and "M" + EARLIER in methods:
        pairs.append(("S", "M" + EARLIER))
    if best_classical is not None:
        pairs += [(name, best_classical) for name in ours]
    titled = {*TITLES, *(name + EARLIER for name in TITLES)}
    return pairs + [("M", name) for name in methods if "M" in methods and name not in titled]


def best_classical(measurements: Iterable[Measurement]) -> str | None:
    """Return the classical method with the highest mean, if there is any."""
    levels: dict[str, list[float]] = {}
    for m in measurements:
        if m.method in CLASSICAL:
            levels.setdefault(m.method, []).append(m.psnr_db)
    return max(levels, key=lambda name: float(np.mean(levels[name])), default=None)


def paired_gains(
    measurements: Sequence[Measurement], pairs: Sequence[tuple[str, str]]
) -> list[dict[str, Any]]:
    """Return every pair's gain over all captures, by ISO and by place, as plain JSON values."""
    entries = []
    for method, reference in pairs:
        gains = _differences(measurements, method, reference)
        if gains:
            entries.append(
                {
                    "method": method,
                    "over": reference,
                    "aim_db": _aim(method, reference),
                    "all": _gain(gains),
                    "by_iso": _split(gains, lambda m: f"{m.iso:g}"),
                    "by_position": _split(gains, lambda m: str(m.position)),
                }
            )
    return entries


def to_lines(gains: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a table in Markdown, a line for each pair."""
    if not gains:
        return []
    isos, places = list(gains[0]["by_iso"]), list(gains[0]["by_position"])
    heads = ["gain in dB, paired", "all", "aim", *(f"ISO {iso}" for iso in isos)]
    cells = [
        [
            f"{title_of(gain['method'])} over {title_of(gain['over'])}",
            _cell(gain["all"]),
            _aim_cell(gain),
            *map(_cell, (*gain["by_iso"].values(), *gain["by_position"].values())),
        ]
        for gain in gains
    ]
    table = markdown_table([*heads, *(f"position {place}" for place in places)], cells)
    return ["### Gains on the same captures", "", table, ""]


def _aim_cell(gain: Mapping[str, Any]) -> str:
    aim = gain["aim_db"]
    if aim is None:
        return ""
    gap_db = aim - gain["all"]["db"]
    return f"{aim:+.1f}: {'reached' if gap_db <= 0 else f'{gap_db:.2f} below'}"


def _aim(method: str, reference: str) -> float | None:
    return AIMS_DB.get((method, CLASSIC if reference in CLASSICAL else reference))


def _cell(gain: Mapping[str, Any]) -> str:
    error = f" +- {gain['error_db']:.2f}" if "error_db" in gain else ""
    return f"{gain['db']:+.2f}{error}"


def _differences(
    measurements: Sequence[Measurement], method: str, reference: str
) -> list[tuple[Measurement, float]]:
    reference_db = {m.capture: m.psnr_db for m in measurements if m.method == reference}
    return [
        (m, m.psnr_db - reference_db[m.capture])
        for m in measurements
        if m.method == method and m.capture in reference_db
    ]


def _split(
    gains: Sequence[tuple[Measurement, float]], key: Callable[[Measurement], str]
) -> dict[str, Any]:
    parts: dict[str, list[tuple[Measurement, float]]] = {}
    for m, gain in gains:
        parts.setdefault(key(m), []).append((m, gain))
    return {name: _gain(parts[name]) for name in sorted(parts, key=float)}


def _gain(gains: Sequence[tuple[Measurement, float]]) -> dict[str, Any]:
    mean_db, error_db = mean_and_error(
        [gain for _, gain in gains], [(m.set_name, m.picture) for m, _ in gains]
    )
    mean = {"db": round(mean_db, 3), "captures": len(gains)}
    return mean if error_db is None else mean | {"error_db": round(error_db, 3)}


def mean_and_error(
    gains: Sequence[float], groups: Sequence[Hashable]
) -> tuple[float, float | None]:
    """Return a mean, and its standard error from the means of groups that are independent.

    Args:
        gains: Of captures.
        groups: What each belongs to: its picture, or its copy of the lens.

    Returns:
        The error is None with fewer than two groups.
    """
    parts: dict[Hashable, list[float]] = {}
    for gain, group in zip(gains, groups, strict=True):
        parts.setdefault(group, []).append(gain)
    means = [float(np.mean(part)) for part in parts.values()]
    error = float(np.std(means, ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else None
    return float(np.mean(gains)), error

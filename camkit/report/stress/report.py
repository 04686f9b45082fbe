"""The JSON of a stress run: one object per scenario, for people's scripts and for CI."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from camkit.bundle.reader import Bundle
from camkit.report.stress.break_point import Break, Grid
from camkit.report.stress.curve import Curve, nearest_break
from camkit.report.stress.scenario import Scenario


def scenario_json(
    curve: Curve, breaks: Sequence[Break], bundle: Bundle, primary: str
) -> dict[str, Any]:
    """Return one scenario as plain JSON values.

    Args:
        curve: What was measured.
        breaks: Of all judged methods.
        bundle: What was tested.
        primary: The method whose nearest break is `break_point`.
    """
    scenario = curve.scenario
    first = nearest_break(curve, breaks, primary)
    faults = [
        {"value": curve.values[i], "scene": curve.scenes[j], "method": m, "fault": o.fault}
        for (i, j), by_method in sorted(curve.outcomes.items())
        for m, o in by_method.items()
        if o.fault is not None
    ]
    return _head(scenario, bundle, primary) | {
        "values": list(curve.values),
        "labels": [curve.label(v) for v in curve.values] if scenario.labels else None,
        "scenes": list(curve.scenes),
        "psnr_db": _means(curve.psnr_db),
        "chi2": _means(curve.chi2),
        "extra": {name: _means(grids) for name, grids in curve.extra.items()},
        "break_point": None if first is None else _round(first.point),
        "ci": None if first is None else [_round(end) for end in first.ci],
        "break_reason": None if first is None else first.reason,
        "breaks": [_break_json(one) for one in breaks],
        "faults": faults,
        "skipped": None,
    }


def skipped_json(scenario: Scenario, reason: str, bundle: Bundle, primary: str) -> dict[str, Any]:
    """Return a scenario that a bundle cannot take."""
    empty: dict[str, Any] = {"psnr_db": {}, "chi2": {}, "extra": {}, "breaks": [], "faults": []}
    return (
        _head(scenario, bundle, primary)
        | empty
        | {
            "values": [],
            "labels": None,
            "scenes": [],
            "break_point": None,
            "ci": None,
            "break_reason": None,
            "skipped": reason,
        }
    )


def _head(scenario: Scenario, bundle: Bundle, primary: str) -> dict[str, Any]:
    return {
        "bundle": bundle.manifest.name,
        "bundle_sha256": bundle.sha256,
        "scenario": scenario.name,
        "title": scenario.title,
        "knob": scenario.knob,
        "unit": scenario.unit,
        "nominal": scenario.nominal,
        "method": primary,
    }


def _break_json(break_point: Break) -> dict[str, Any]:
    return {
        "method": break_point.method,
        "side": break_point.side,
        "break_point": _round(break_point.point),
        "ci": [_round(end) for end in break_point.ci],
        "reason": break_point.reason or None,
    }


def _means(grids: Mapping[str, Grid]) -> dict[str, list[float | None]]:
    """Return method -> mean over the scenes per value, None where no scene knows."""
    return {method: [_mean(row) for row in grid] for method, grid in grids.items()}


def _mean(row: Grid) -> float | None:
    finite = row[np.isfinite(row)]
    return round(float(finite.mean()), 4) if finite.size else None


def _round(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")

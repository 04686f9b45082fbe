"""Values x scenes, one after the other, journalled so that a run may be stopped and resumed."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from camkit.report.journal import append_journal, read_journal
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.verdict import Examiner, Outcome, SweptScene, Verdict

JOURNAL_VERSION: Final = 3
"""Raised when the same bundle and methods give other points than before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One scenario at one value on one scene.

    Attributes:
        scenario: Name.
        value: Of the knob.
        scene: Name.
        verdict: All methods.
    """

    scenario: str
    value: float
    scene: str
    verdict: Verdict

    @property
    def key(self) -> tuple[str, float, str]:
        """Return what names the point."""
        return self.scenario, self.value, self.scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Points that are to be measured.

    Attributes:
        scenarios: In order.
        scenes: On which.
        quick: Only the quick values.
    """

    scenarios: tuple[Scenario, ...]
    scenes: tuple[SweptScene, ...]
    quick: bool = False

    def tasks(self) -> list[tuple[Scenario, float, SweptScene]]:
        """Return scenario, value and scene of every point, scenario by scenario."""
        return [
            (scenario, value, scene)
            for scenario in self.scenarios
            for scene in self.scenes
            for value in scenario.swept_values(quick=self.quick)
        ]


def run_sweep(sweep: Sweep, judge: Examiner, journal: Path | None) -> Iterator[Point]:
    """Measure what the journal does not hold yet, and give all points of the sweep in order.

    Args:
        sweep: Points that are to be measured.
        judge: Restores and judges.
        journal: One JSON line per finished point; None keeps none.

    Raises:
        ContractError: If the journal is damaged.
    """
    finished = {} if journal is None else {p.key: p for p in read_points(journal)}
    for scenario, value, scene in sweep.tasks():
        key = (scenario.name, value, scene.name)
        point = finished.get(key)
        if point is None:
            verdict = scenario.take(judge, scene, value)
            point = Point(scenario=key[0], value=value, scene=key[2], verdict=verdict)
            if journal is not None:
                append_journal(journal, [asdict(point)])
        yield point


def sweep_identity(judge: Examiner) -> str:
    """Return a short hash of what decides the points of a journal."""
    parts = [JOURNAL_VERSION, *judge.identity]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]


def read_points(journal: Path) -> list[Point]:
    """Read the points of an earlier sweep.

    Raises:
        ContractError: If the journal is damaged.
    """
    return read_journal(journal, _to_point, "point of a sweep")


def _to_point(record: Mapping[str, object]) -> Point:
    verdict = record["verdict"]
    if not isinstance(verdict, dict):
        raise TypeError("a verdict is an object")
    outcomes = {
        name: Outcome(**{**entry, "patch_px": _pair(entry["patch_px"])})
        for name, entry in verdict["outcomes"].items()
    }
    return Point(
        scenario=str(record["scenario"]),
        value=float(str(record["value"])),
        scene=str(record["scene"]),
        verdict=Verdict(outcomes=outcomes, seen=verdict["seen"]),
    )


def _pair(values: Sequence[int] | None) -> tuple[int, int] | None:
    return None if values is None else (values[0], values[1])

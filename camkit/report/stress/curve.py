"""The points of one scenario as arrays over value and scene, and where its methods break."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from camkit.report.stress.break_point import Break, Grid, Margins, find_break, margins_of
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.sweep import Point
from camkit.report.stress.verdict import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Measurements of one scenario.

    Attributes:
        scenario: The scenario.
        values: (n,) of the knob.
        scenes: Names.
        psnr_db: Method -> (n, scenes), NaN where unknown.
        chi2: Method -> (n, scenes), NaN where unknown.
        extra: Name -> method -> (n, scenes).
        quantities: Quantity of the runtime -> (n, scenes).
        outcomes: (value index, scene index) -> method -> outcome.
        rivals: Methods that the others must not fall behind.
    """

    scenario: Scenario
    values: tuple[float, ...]
    scenes: tuple[str, ...]
    psnr_db: Mapping[str, Grid]
    chi2: Mapping[str, Grid]
    extra: Mapping[str, Mapping[str, Grid]]
    quantities: Mapping[str, Grid]
    outcomes: Mapping[tuple[int, int], Mapping[str, Outcome]]
    rivals: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Name the methods that were measured."""
        return tuple(self.psnr_db)

    @property
    def judged(self) -> tuple[str, ...]:
        """Name the methods that may break."""
        return tuple(m for m in self.methods if m not in self.rivals)

    @property
    def nominal(self) -> int:
        """Return the index of the nominal value."""
        return self.values.index(self.scenario.nominal)

    def label(self, value: float) -> str:
        """Return a value for people."""
        if self.scenario.labels:
            return self.scenario.labels[self.scenario.values.index(value)]
        return f"{value:g} {self.scenario.unit}".rstrip()


def curve_of(scenario: Scenario, points: Iterable[Point], rivals: tuple[str, ...]) -> Curve:
    """Collect the points of one scenario.

    Args:
        scenario: The scenario.
        points: Of a sweep.
        rivals: Methods that the others must not fall behind.
    """
    mine = [p for p in points if p.scenario == scenario.name]
    values = tuple(sorted({p.value for p in mine}))
    scenes = tuple(dict.fromkeys(p.scene for p in mine))
    outcomes = {(values.index(p.value), scenes.index(p.scene)): p.verdict.outcomes for p in mine}
    methods = tuple(dict.fromkeys(m for by_method in outcomes.values() for m in by_method))
    shape = (len(values), len(scenes))
    extras = dict.fromkeys(n for o in outcomes.values() for m in o.values() for n in m.extra)
    by_point = {(values.index(p.value), scenes.index(p.scene)): p.verdict.seen for p in mine}
    quantities = dict.fromkeys(name for numbers in by_point.values() for name in numbers)

    def grid(method: str, name: str) -> Grid:
        cells = {
            at: getattr(by_method[method], name)
            for at, by_method in outcomes.items()
            if method in by_method
        }
        return _fill(shape, cells)

    def extra_grid(method: str, name: str) -> Grid:
        cells = {at: o[method].extra.get(name) for at, o in outcomes.items() if method in o}
        return _fill(shape, cells)

    return Curve(
        scenario=scenario,
        values=values,
        scenes=scenes,
        psnr_db={m: grid(m, "psnr_db") for m in methods},
        chi2={m: grid(m, "chi2") for m in methods},
        extra={name: {m: extra_grid(m, name) for m in methods} for name in extras},
        quantities={
            q: _fill(shape, {at: s.get(q) for at, s in by_point.items()}) for q in quantities
        },
        outcomes=outcomes,
        rivals=rivals,
    )


def _fill(shape: tuple[int, int], cells: Mapping[tuple[int, int], float | None]) -> Grid:
    grid = np.full(shape, np.nan)
    for at, value in cells.items():
        grid[at] = np.nan if value is None else value
    return grid


def margins(curve: Curve, method: str) -> Margins:
    """Return how far a method is from breaking."""
    rivals: Sequence[str] = curve.rivals if curve.scenario.rival else ()
    faults = np.zeros((len(curve.values), len(curve.scenes)), dtype=bool)
    for at, by_method in curve.outcomes.items():
        faults[at] = method in by_method and by_method[method].fault is not None
    grids = {m: grid for m, grid in curve.psnr_db.items() if m == method or m in rivals}
    return Margins(
        values=np.array(curve.values),
        nominal=curve.nominal,
        gains=margins_of(
            grids, curve.chi2[method], method=method, rivals=[r for r in rivals if r in grids]
        ),
        faults=faults,
        log=curve.scenario.log,
        ordered=not curve.scenario.labels,
    )


def breaks_of(curve: Curve) -> tuple[Break, ...]:
    """Find the break points of every judged method, on every side of the nominal that was swept."""
    breaks = []
    for method in curve.judged:
        margin = margins(curve, method)
        if curve.nominal > 0:
            breaks.append(find_break(margin, method, "down"))
        if curve.nominal < len(curve.values) - 1:
            breaks.append(find_break(margin, method, "up"))
    return tuple(breaks)


def nearest_break(curve: Curve, breaks: Sequence[Break], method: str) -> Break | None:
    """Return break of a method that is the fewest steps from the nominal value; None if none."""
    values, nominal = np.array(curve.values), curve.nominal

    def steps(candidate: Break) -> float:
        assert candidate.point is not None
        return abs(float(np.interp(candidate.point, values, np.arange(values.size))) - nominal)

    mine = [b for b in breaks if b.method == method and b.point is not None]
    return min(mine, key=steps) if mine else None

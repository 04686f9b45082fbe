"""No reconstruction: what `camkit process --bundle none` does, the floor of time and quality."""

from camkit.report.bench.case import Axes, Case, Entrant, Ground, Skip
from camkit.report.bench.row_kind import RowKind


def make_cases(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Case], list[Skip]]:
    """Give one case for the captures of every camera."""
    if entrant.is_reference:
        return [], []
    threads = ground.base_threads(axes)
    case = Case(
        camera=entrant.camera,
        bundle=entrant.label,
        path=None,
        kind=KIND.name,
        method="develop",
        threads=threads,
        base_threads=threads,
    )
    return [case], []


KIND = RowKind(name="develop", methods=("develop",), cases=make_cases)

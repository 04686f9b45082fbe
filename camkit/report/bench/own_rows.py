"""Bundles of kinds that measure themselves: which they are, their rows in one report, as text."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.bench.machine import describe_machine
from camkit.report.bench.part import BenchPart, Measure, OwnSettings, Tell
from camkit.report.bench.settings import Settings
from camkit.report.bench.tuning import whole_tuning
from camkit.report.kind_finder import find_part

OPTIONS: Final = "--data, --images, --sizes, --repeat, --quick"
"""What means something to a kind that measures itself."""
FOREIGN_AXES: Final = {
    "--methods": "methods",
    "--modes": "modes",
    "--dtypes": "dtypes",
    "--providers": "providers",
    "--threads": "threads",
    "--tile": "tiles_px",
}
FOREIGN: Final = {
    "--width": "width_px",
    "--height": "height_px",
    "--capture": "capture",
    "--photo": "photo",
    "--saturate": "saturate",
    "--work-dir": "work_dir",
}
"""What means nothing to it: option -> field of the axes, of the settings."""
SORT: Final = "sort"
"""Column that says which sort a row is of."""
OwnRow = Mapping[str, Any]


def measures_of(bundles: Sequence[Bundle]) -> tuple[Measure, ...]:
    """Return what measures each bundle; nothing for cameras that photograph.

    Raises:
        ContractError: If some photograph and others measure themselves.
    """
    by_path = {b.path: find_part(b.manifest.kind, "bench", BenchPart).measure for b in bundles}
    measures = tuple(measure for measure in by_path.values() if measure is not None)
    if measures and len(measures) < len(by_path):
        names = [b.manifest.name for b in bundles if by_path[b.path] is not None]
        raise ContractError(
            f"{', '.join(names)} takes no photographs and measures itself: bench it in a call of "
            "its own"
        )
    return measures


def measure_own(
    settings: Settings, bundles: Sequence[Bundle], measures: Sequence[Measure], tell: Tell
) -> dict[str, Any]:
    """Measure bundles whose kinds measure themselves.

    Args:
        settings: What to measure.
        bundles: Which ones.
        measures: What measures each of them.
        tell: Called with a line whenever something begins.

    Returns:
        Plain JSON values: machine, settings, bundles, tuning, rows, skipped.

    Raises:
        ContractError: If something is asked for that means nothing to such a kind.
    """
    if unknown := _foreign(settings):
        names = ", ".join(bundle.manifest.name for bundle in bundles)
        raise ContractError(
            f"{names} takes no photographs, so {', '.join(unknown)} does not apply to it; it knows "
            f"{OPTIONS}"
        )
    own_settings = OwnSettings(
        data=settings.data,
        images=settings.images,
        sizes=settings.axes.sizes,
        quick=settings.small,
        repeat=settings.repeat,
    )
    rows: list[dict[str, Any]] = []
    skipped: list[dict[str, str]] = []
    tuning: list[dict[str, Any]] = []
    for bundle, measure in zip(bundles, measures, strict=True):
        own_rows, name = measure(bundle, own_settings, tell), bundle.manifest.name
        for other in (bundle, *own_rows.other_bundles):
            tuning += whole_tuning(name, other)
        rows += [{"bundle": name, **row} for row in own_rows.rows]
        skipped += [skip._asdict() for skip in own_rows.skips]
    return {
        "machine": describe_machine(),
        "settings": {
            "data": None if own_settings.data is None else own_settings.data.name,
            "images": own_settings.images,
            "sizes": own_settings.sizes,
            "quick": own_settings.quick,
            "repeat": own_settings.repeat,
        },
        "bundles": {bundle.manifest.name: bundle.sha256 for bundle in bundles},
        "tuning": tuning,
        "rows": rows,
        "skipped": skipped,
    }


def _foreign(settings: Settings) -> list[str]:
    """Return the options that were given and mean nothing here."""
    options = ["--reference"] if settings.references else []
    options += [name for name, at in FOREIGN_AXES.items() if getattr(settings.axes, at) is not None]
    options += [name for name, at in FOREIGN.items() if getattr(settings, at) is not None]
    return options + [f"--{name.replace('_', '-')}" for name in settings.constants]


def own_lines(rows: Iterable[OwnRow]) -> list[str]:
    """Return the lines of a table for every sort of row; columns without any value are left out."""
    sorts: dict[Any, list[OwnRow]] = {}
    for row in rows:
        sorts.setdefault(row.get(SORT), []).append(row)
    lines: list[str] = []
    for name, same in sorts.items():
        lines += [*([""] if lines else []), *([] if name is None else [str(name)]), *_table(same)]
    return lines


def _table(rows: list[OwnRow]) -> list[str]:
    keys = dict.fromkeys(key for row in rows for key in row if key != SORT)
    columns = [key for key in keys if any(row.get(key) is not None for row in rows)]
    cells = [columns, *([_cell(row.get(key)) for key in columns] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(columns))]
    return [
        "  ".join(w.ljust(n) for w, n in zip(line, widths, strict=True)).rstrip() for line in cells
    ]


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)

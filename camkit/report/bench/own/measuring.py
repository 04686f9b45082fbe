"""Bundles of kinds that measure themselves: which they are, and their rows in one report."""

from collections.abc import Sequence
from typing import Any, Final

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.bench.machine import describe_machine
from camkit.report.bench.part import BenchPart, Measure, OwnSettings, Tell
from camkit.report.bench.settings import Settings
from camkit.report.bench.trial import Axes
from camkit.report.bench.tuning import whole_tuning
from camkit.report.kind_finder import find_part

OPTIONS: Final = "--data, --images, --sizes, --repeat, --quick"
"""What means something to a kind that measures itself."""


def measures_of(bundles: Sequence[Bundle]) -> tuple[Measure, ...]:
    """Return what measures each bundle; nothing for cameras that photograph.

    Raises:
        ContractError: If some photograph and others measure themselves.
    """
    found = {b.path: find_part(b.manifest.kind, "bench", BenchPart).measure for b in bundles}
    own = tuple(measure for measure in found.values() if measure is not None)
    if own and len(own) < len(found):
        names = [b.manifest.name for b in bundles if found[b.path] is not None]
        raise ContractError(
            f"{', '.join(names)} takes no photographs and measures itself: bench it in a call of "
            "its own"
        )
    return own


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
    own = OwnSettings(
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
        found = measure(bundle, own, tell)
        for other in (bundle, *found.beside):
            tuning += whole_tuning(bundle.manifest.name, other)
        rows += [{"bundle": bundle.manifest.name, **row} for row in found.rows]
        skipped += [{"what": skip.what, "reason": skip.reason} for skip in found.skips]
    return {
        "machine": describe_machine(),
        "settings": {
            "data": None if own.data is None else own.data.name,
            "images": own.images,
            "sizes": own.sizes,
            "quick": own.quick,
            "repeat": own.repeat,
        },
        "bundles": {bundle.manifest.name: bundle.sha256 for bundle in bundles},
        "tuning": tuning,
        "rows": rows,
        "skipped": skipped,
    }


def _foreign(settings: Settings) -> list[str]:
    """Name the options that were given and mean nothing here."""
    axes, usual = settings.axes, Axes()
    given = {
        "--reference": bool(settings.references),
        "--methods": axes.methods != usual.methods,
        "--modes": axes.modes != usual.modes,
        "--dtypes": axes.dtypes != usual.dtypes,
        "--providers": axes.providers != usual.providers,
        "--threads": axes.threads != usual.threads,
        "--tile": axes.tiles_px != usual.tiles_px,
        "--width": settings.width_px is not None,
        "--height": settings.height_px is not None,
        "--capture": settings.capture is not None,
        "--photo": settings.photo is not None,
        "--saturate": settings.saturate is not None,
        "--work-dir": settings.work_dir is not None,
    }
    named = [f"--{name.replace('_', '-')}" for name in settings.constants]
    return [name for name, is_given in given.items() if is_given] + named

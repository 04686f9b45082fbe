"""One stress run: sweep, break points, measured ranges, and the files that tell of them.

DIR/points-IDENTITY.jsonl   the journal; an interrupted run goes on where it stopped
DIR/stress.json             what `--json` prints
DIR/stress.html             the page
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.bundle.manifest import Range
from camkit.bundle.reader import Bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.report.figure import to_png
from camkit.report.kind_finder import camera_of, find_part
from camkit.report.pages.page import to_html
from camkit.report.stress.break_point import Break
from camkit.report.stress.curve import Curve, breaks_of, curve_of
from camkit.report.stress.measured_ranges import measured_ranges
from camkit.report.stress.report import scenario_json, skipped_json
from camkit.report.stress.scenario import Scenario, choose
from camkit.report.stress.stress_chart import draw_curve
from camkit.report.stress.stress_page import Swept, stress_page, worst_patches
from camkit.report.stress.stress_part import StressPart
from camkit.report.stress.sweep import Sweep, run_sweep, sweep_identity
from camkit.report.stress.verdict import Examiner, SweptScene

DEFAULT_SCENES: Final = 8
QUICK_SCENES: Final = 2
PAGE: Final = "stress.html"
RESULTS: Final = "stress.json"

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class StressOptions:
    """Settings of a run.

    Attributes:
        scenarios: In order.
        sizes: Of the network; empty for all that the bundle holds.
        scenes: How many; None for 8, or 2 when quick.
        quick: Few values.
        data_folder: Pictures instead of procedural scenes.
        out_dir: Where journal, page and results go; None keeps nothing.
    """

    scenarios: tuple[Scenario, ...]
    sizes: tuple[str, ...] = ()
    scenes: int | None = None
    quick: bool = False
    data_folder: Path | None = None
    out_dir: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StressResult:
    """Results of a run.

    Attributes:
        rows: One JSON object per scenario.
        envelope: The measured ranges of the primary method.
        primary: Its name.
        curves: What was measured.
        breaks: Scenario -> break points of all judged methods.
        page: Where the page lies; None if none was written.
    """

    rows: list[dict[str, Any]]
    envelope: dict[str, Range]
    primary: str
    curves: tuple[Curve, ...]
    breaks: Mapping[str, tuple[Break, ...]]
    page: Path | None


def scenarios_for(bundle: Bundle, names: str | None) -> tuple[Scenario, ...]:
    """Return scenarios that a comma-separated list names, those of the bundle's kind among them.

    Raises:
        ContractError: If one is unknown.
    """
    return choose(names, find_part(bundle.manifest.kind, "stress", StressPart).scenarios)


def run_stress(
    bundle: Bundle,
    options: StressOptions,
    *,
    earlier_bundle: Bundle | None = None,
    progress: Progress | None = None,
) -> StressResult:
    """Sweep a bundle.

    Args:
        bundle: What is tested.
        options: Settings of a run.
        earlier_bundle: Another bundle of the same camera, whose networks are shown beside.
        progress: Called with (scenario, points done, points in all).

    Raises:
        ContractError: If sizes, scenes or bundles do not fit.
        BundleError: If the camera cannot be photographed with.
    """
    _check_same_camera(bundle, earlier_bundle)
    reasons = {s.name: s.applies(bundle) for s in options.scenarios}
    scenarios = tuple(s.for_bundle(bundle) for s in options.scenarios if reasons[s.name] is None)
    count = options.scenes or (QUICK_SCENES if options.quick else DEFAULT_SCENES)
    part = find_part(bundle.manifest.kind, "stress", StressPart)
    judge = part.examiner(bundle, options.sizes or bundle.manifest.sizes, earlier_bundle)
    primary = judge.primary
    scenes = part.scenes(bundle, count, options.data_folder)
    sweep = Sweep(scenarios=scenarios, scenes=scenes, quick=options.quick)
    points, total = [], len(sweep.tasks())
    for point in run_sweep(sweep, judge, _journal(options, judge)):
        points.append(point)
        if progress is not None:
            progress(point.scenario, len(points), total)
    curves = tuple(
        curve_of(scenario, points, scenario.rivals or judge.rivals) for scenario in scenarios
    )
    breaks = {c.scenario.name: breaks_of(c) for c in curves}
    rows = [scenario_json(c, breaks[c.scenario.name], bundle, primary) for c in curves]
    rows += [
        skipped_json(s, reason, bundle, primary)
        for s in options.scenarios
        if (reason := reasons[s.name]) is not None
    ]
    envelope = measured_ranges(curves, primary)
    result = StressResult(
        rows=rows,
        envelope=envelope,
        primary=primary,
        curves=curves,
        breaks=breaks,
        page=_page_path(options),
    )
    if options.out_dir is not None:
        _write(options.out_dir, result, bundle, (judge, scenes))
    return result


def write_envelope(bundle: Bundle, envelope: Mapping[str, Range]) -> Bundle:
    """Store measured ranges in a bundle file; ranges of other quantities are kept.

    Raises:
        ContractError: If nothing was measured.
    """
    if not envelope:
        raise ContractError("no range was measured, so there is nothing to write; see the report")
    stored = bundle.manifest.envelope or {}
    manifest = bundle.manifest.model_copy(update={"envelope": {**stored, **envelope}})
    members = {name: bundle.member(name) for name in bundle.names}
    return write_bundle(bundle.path, manifest, members)


def _check_same_camera(bundle: Bundle, earlier_bundle: Bundle | None) -> None:
    if earlier_bundle is not None and camera_of(earlier_bundle.manifest) != camera_of(
        bundle.manifest
    ):
        raise ContractError(
            f"bundles {earlier_bundle.path} and {bundle.path} are not of one camera; compare "
            "networks on one camera only"
        )


def _journal(options: StressOptions, judge: Examiner) -> Path | None:
    if options.out_dir is None:
        return None
    return options.out_dir / f"points-{sweep_identity(judge)}.jsonl"


def _page_path(options: StressOptions) -> Path | None:
    return None if options.out_dir is None else options.out_dir / PAGE


def _write(
    folder: Path,
    result: StressResult,
    bundle: Bundle,
    ground: tuple[Examiner, tuple[SweptScene, ...]],
) -> None:
    """Write results and page."""
    judge, scenes = ground
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(result.rows, indent=1) + "\n"
    (folder / RESULTS).write_text(text, encoding="utf-8")
    swept = []
    for curve in result.curves:
        breaks = result.breaks[curve.scenario.name]
        swept.append(
            Swept(
                curve=curve,
                breaks=breaks,
                chart=to_png(draw_curve(curve, breaks)),
                patches=worst_patches(curve, judge, scenes, result.primary),
            )
        )
    manifest = bundle.manifest
    facts = {
        "bundle": f"{manifest.name} {manifest.version}, sha256 {bundle.sha256[:16]}",
        "networks": ", ".join(m for m in judge.methods if m not in judge.rivals) or "none",
        "scenes": ", ".join(scene.name for scene in scenes),
        "captures": str(sum(len(c.outcomes) for c in result.curves)),
    }
    skipped = {row["title"]: row["skipped"] for row in result.rows if row["skipped"]}
    page = stress_page(
        f"Where {manifest.name} fails", facts, swept, skipped=skipped, envelope=result.envelope
    )
    (folder / PAGE).write_text(to_html(page), encoding="utf-8")

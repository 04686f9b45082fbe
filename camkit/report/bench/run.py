"""The whole bench: trials made, timed in interleaved rounds, judged, and joined in rows."""

import shutil
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from camkit.bundle.manifest import NOT_TRAINED
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.errors import CamkitError, ContractError
from camkit.progress import counted, working
from camkit.report.bench.accuracy import Key, Restorers, Scores, measure_accuracy, score_key
from camkit.report.bench.crops import MOST_CAPTURES, CropCollector, Patch
from camkit.report.bench.edge import Edges, measure_edges
from camkit.report.bench.gemm import gemm_peak_gmac_per_s
from camkit.report.bench.known_captures import (
    SCENES,
    KnownCapture,
    bench_scene,
    golden_captures,
    picture_captures,
    scene_captures,
)
from camkit.report.bench.line_up import make_trials, metrics_of
from camkit.report.bench.machine import describe_machine, free_memory_bytes
from camkit.report.bench.metric import Metric
from camkit.report.bench.own_rows import measure_own, measures_of
from camkit.report.bench.part import BenchPart, Tell
from camkit.report.bench.row import Facts, make_row
from camkit.report.bench.settings import QUICK_SIZE_PX, Settings
from camkit.report.bench.timed.capture import SCENE_TEXT, timed_capture
from camkit.report.bench.timed.process_run import Job, Run, run_job
from camkit.report.bench.timed.timing import interleaved
from camkit.report.bench.trial import BASE_SIZE, Entrant, Ground, Skip, Trial
from camkit.report.bench.tuning import tuning_table
from camkit.report.kind_finder import camera_of, check_photographs, find_part
from camkit.report.quality import LIGHT_SUFFIXES, list_set, read_picture
from camkit.runtime.kind import part_of
from camkit.runtime.network.engine import available_threads, usable_providers
from camkit.runtime.options import Options
from camkit.runtime.plan.ways import offered_methods

REPORT_VERSION: Final = 1


class _TimedShot(NamedTuple):
    """The capture of a camera that is timed: its (width, height), and what it shows."""

    file: Path
    size_px: tuple[int, int]
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Results of a bench.

    Attributes:
        report: Plain JSON values: machine, settings, cameras, rows, skipped.
        self_measured: Whether its kinds measured themselves; then rows have their own columns.
        patches: Camera -> the same patches of every method, by `Trial.accuracy_key`.
        names: `Trial.accuracy_key` -> label.
    """

    report: dict[str, Any]
    self_measured: bool = False
    patches: dict[str, list[Patch]] = field(default_factory=dict)
    names: dict[Key, str] = field(default_factory=dict)


def run_bench(settings: Settings, tell: Tell = lambda _text: None) -> Result:
    """Run a bench.

    Args:
        settings: What to measure.
        tell: Called with a line whenever something begins.

    Raises:
        ContractError: If bundles, methods, pictures or settings do not fit each other.
        BundleError: If a bundle is refused.
        DecodeError: If the given capture or a file of linear light cannot be read.
    """
    entrants = open_entrants(settings.bundles, settings.references)
    opened = [entrant.bundle for entrant in entrants]
    if measures := measures_of(opened):
        return Result(report=measure_own(settings, opened, measures, tell), self_measured=True)
    folder = settings.folder()
    cameras = [entrant for entrant in entrants if not entrant.is_reference]
    _check(settings, [entrant.bundle for entrant in cameras])
    ground = Ground(
        threads=available_threads(None),
        providers=usable_providers(),
        free_bytes=free_memory_bytes(),
    )
    trials, skips = make_trials(entrants, settings.axes, ground)
    if not trials:
        raise ContractError(_nothing(entrants, skips))
    shots = {}
    for entrant in cameras:
        tell(f"{entrant.label}: preparing the capture")
        shots[entrant.label] = _timed_shot(entrant.bundle, settings, folder)
    machine = describe_machine()
    peaks = {n: gemm_peak_gmac_per_s(n, settings.gemm_s) for n in {t.threads for t in trials}}
    machine["gemm_gmac_per_s"] = {str(n): round(peak, 2) for n, peak in sorted(peaks.items())}
    files = {label: shot.file for label, shot in shots.items()}
    runs = time_trials(trials, files, settings.repeat, tell)
    bundles = {entrant.label: entrant.bundle for entrant in entrants}
    random = {label for label, bundle in bundles.items() if not bundle.manifest.is_trained}
    idle = [trial for trial in trials if trial.bundle in random and trial.size is not None]
    skips += [Skip(what=f"accuracy of {t.camera} {t.label}", reason=NOT_TRAINED) for t in idle]
    scored = [trial for trial in trials if trial not in idle]
    judged = {camera.label: _judge(camera, scored, settings, folder, tell) for camera in cameras}
    skips += [
        Skip(what=f"accuracy of {label}", reason=judgement.error)
        for label, judgement in judged.items()
        if judgement.error is not None
    ]
    skips += [skip for judgement in judged.values() for skip in judgement.edges.skips]

    rows = [
        make_row(trial, runs[trial], _facts(trial, trials, shots, judged, runs, peaks, bundles))
        for trial in trials
    ]
    report = {
        "report_version": REPORT_VERSION,
        "machine": machine,
        "repeat": settings.repeat,
        "cameras": {
            label: {
                "width": shot.size_px[0],
                "height": shot.size_px[1],
                "capture": shot.text,
                "accuracy": judged[label].text,
                "bundle_sha256": bundles[label].sha256,
            }
            for label, shot in shots.items()
        },
        "tuning": tuning_table(trials, bundles),
        "rows": rows,
        "skipped": [skip._asdict() for skip in skips],
    }
    return Result(
        report=report,
        patches={label: judgement.patches for label, judgement in judged.items()},
        names={trial.accuracy_key: trial.label for trial in reversed(trials)},
    )


def _nothing(entrants: Sequence[Entrant], skips: Sequence[Skip]) -> str:
    """Return why there is nothing to measure, and what there is."""
    why = [f"{skip.what}: {skip.reason}" for skip in skips]
    have = [
        f"{entrant.label} has {', '.join(offered_methods(manifest.stages, manifest.all_planes))}"
        for entrant in entrants
        if (manifest := entrant.bundle.manifest)
    ]
    return f"nothing to measure: {'; '.join([*why, *have])} (--methods)"


def _check(settings: Settings, bundles: Sequence[Bundle]) -> None:
    """Refuse settings and pictures that do not fit the cameras, before anything is timed."""
    constants = {name for b in bundles for m in metrics_of(b.manifest) for name in m.takes}
    if unknown := [name for name in settings.constants if name not in constants]:
        raise ContractError(
            f"none of these cameras is judged by a metric that takes {', '.join(unknown)}"
        )
    if settings.data is not None or settings.saturate is not None:
        for bundle in bundles:
            check_photographs(
                bundle.manifest,
                "leave out --data and --saturate: its golden cases say how well it does",
            )
    sources = [find_part(b.manifest.kind, "bench", BenchPart).source for b in bundles]
    if settings.saturate is not None and settings.data is None and None in sources:
        raise ContractError("a share to saturate is one of pictures; give their folder as data")
    for path in () if settings.data is None else list_set(settings.data, settings.images):
        if settings.saturate is not None:
            for bundle in bundles:
                bench_scene(path, bundle, settings.saturate)
        elif path.suffix.lower() in LIGHT_SUFFIXES:
            read_picture(path)


def open_entrants(bundles: Sequence[str], references: Sequence[str]) -> list[Entrant]:
    """Open all bundles; references follow the bundle of their camera.

    Raises:
        BundleError: If one is refused.
        ContractError: If a reference is of no camera, or two have one label.
    """
    opened = [open_bundle(find_bundle(name)) for name in bundles]
    entrants = [Entrant(label=b.manifest.name, bundle=b, camera=b.manifest.name) for b in opened]
    for name in references:
        bundle = open_bundle(find_bundle(name))
        camera = camera_of(bundle.manifest)
        host = next((b for b in opened if camera_of(b.manifest) == camera), None)
        if host is None:
            raise ContractError(
                f"{bundle.path.name} is the camera of none of the bundles; a reference must be of "
                "the same camera as one of them"
            )
        entrants.append(Entrant(label=bundle.path.stem, bundle=bundle, camera=host.manifest.name))
    labels = [entrant.label for entrant in entrants]
    if len(set(labels)) != len(labels):
        raise ContractError(f"two bundles have one name ({', '.join(labels)}); rename a file")
    return entrants


def _timed_shot(bundle: Bundle, settings: Settings, folder: Path) -> _TimedShot:
    manifest, file, photo = bundle.manifest, settings.capture, settings.photo
    if file is not None:
        capture = part_of(manifest).read(file, None, manifest, Options())
        return _TimedShot(file, (capture.width, capture.height), file.name)
    width, height = settings.width_px, settings.height_px
    if settings.small:
        extent = manifest.sensor.extent
        most = QUICK_SIZE_PX if extent is None else (extent.width_px, extent.height_px)
        width = width or min(QUICK_SIZE_PX[0], most[0])
        height = height or min(QUICK_SIZE_PX[1], most[1])
    path, size_px = timed_capture(bundle, width, height, folder, photo)
    return _TimedShot(path, size_px, photo.name if photo else SCENE_TEXT)


def time_trials(
    trials: Sequence[Trial], captures: dict[str, Path], repeat: int, tell: Tell
) -> dict[Trial, list[Run]]:
    """Run every trial in fresh processes, all once per round; a trial that fails drops out."""
    runs: dict[Trial, list[Run]] = {trial: [] for trial in trials}
    with tempfile.TemporaryDirectory(prefix="camkit-bench-") as name:
        folder = Path(name)
        twins = {label: _twins(capture, folder / label) for label, capture in captures.items()}
        for trial in counted(list(interleaved(trials, repeat)), "timing", "runs"):
            if any(run.error is not None for run in runs[trial]):
                continue
            tell(f"{trial.camera}: timing {trial.label}")
            job = Job(
                files=twins[trial.camera],
                bundle="none" if trial.path is None else str(trial.path.resolve()),
                out_dir=folder / "out",
                options=trial.options(),
            )
            runs[trial].append(run_job(job))
    return runs


def _twins(capture: Path, folder: Path) -> tuple[Path, ...]:
    """Return the capture under two names: the first run of a process, and the steady one."""
    folder.mkdir()
    twins = tuple(folder / f"{name}{capture.suffix}" for name in ("first", "steady"))
    for twin in twins:
        shutil.copyfile(capture, twin)
    return twins


@dataclass(frozen=True, slots=True, kw_only=True)
class _Judged:
    scores: dict[Key, Scores]
    patches: list[Patch]
    metrics: tuple[Metric, ...]
    text: str
    edges: Edges = field(default_factory=Edges)
    error: str | None = None


def _judge(
    camera: Entrant, trials: Sequence[Trial], settings: Settings, folder: Path, tell: Tell
) -> _Judged:
    """Measure the accuracy of all methods of one camera; without it the seconds still stand."""
    bundle, label = camera.bundle, camera.label
    camera_trials = [trial for trial in trials if trial.camera == label]
    metrics = metrics_of(bundle.manifest)
    captures, count, text = _known_captures(bundle, settings, folder)
    plain = [trial.accuracy_key for trial in camera_trials if not trial.is_variant]
    collector = CropCollector(plain, every=max(1, count // MOST_CAPTURES))

    def with_progress(queue: Iterable[KnownCapture]) -> Iterable[KnownCapture]:
        with working("judging", count, unit="captures") as task:
            for number, known_capture in enumerate(queue):
                task.count(number)
                tell(f"{label}: judging {known_capture.caption}")
                yield known_capture

    restorers = Restorers(bundle, available_threads(None))
    try:
        scores = measure_accuracy(
            camera_trials,
            with_progress(captures),
            restorers,
            metrics,
            collector.take,
            settings.constants,
        )
    except CamkitError as error:
        text = f"not measured: {error}"
        return _Judged(scores={}, patches=[], metrics=metrics, text=text, error=str(error))
    tell(f"{label}: judging an edge")
    return _Judged(
        scores=scores,
        patches=collector.patches,
        metrics=metrics,
        text=text,
        edges=measure_edges(bundle, camera_trials, restorers),
    )


def _known_captures(
    bundle: Bundle, settings: Settings, folder: Path
) -> tuple[Iterable[KnownCapture], int, str]:
    """Return the captures to judge on, how many there are, and what they are."""
    part = find_part(bundle.manifest.kind, "bench", BenchPart)
    count, psf = settings.images, folder / "psf"
    if settings.data is not None:
        pictures = len(list_set(settings.data, count))
        captures = picture_captures(bundle, settings.data, count, psf, settings.saturate)
        what = f"{pictures} pictures of {settings.data.name}"
    elif part.source is not None:
        pictures = count or SCENES
        captures = scene_captures(bundle, count, psf, settings.saturate)
        what = f"scenes {part.source}:0 to {part.source}:{pictures - 1}"
    else:
        golden = golden_captures(bundle)
        return golden, len(golden), f"{len(golden)} golden cases of the bundle"
    text = (
        f"{what}, {len(part.positions)} field positions, "
        f"ISO {' and '.join(f'{iso:g}' for iso in part.isos)}"
    )
    if settings.saturate is not None:
        text += f", {settings.saturate:.3%} of the scene saturated"
    return captures, pictures * len(part.positions) * len(part.isos), text


def _facts(
    trial: Trial,
    trials: Sequence[Trial],
    shots: dict[str, _TimedShot],
    judged: dict[str, _Judged],
    runs: dict[Trial, list[Run]],
    peaks: dict[int, float],
    bundles: dict[str, Bundle],
) -> Facts:
    """Return what the row of `trial` is made of, besides its own runs."""
    base, judgement = _base_of(trial, trials), judged[trial.camera]
    manifest = bundles[trial.bundle].manifest
    return Facts(
        size_px=shots[trial.camera].size_px,
        mac_per_px=None if trial.size is None else manifest.mac_per_pixel(trial.size),
        gemm_gmac_per_s=peaks[trial.threads],
        scores=judgement.scores,
        metrics=judgement.metrics,
        edges=judgement.edges,
        base=runs[base],
        base_label=base.label,
        base_key=score_key(base),
    )


def _base_of(trial: Trial, trials: Sequence[Trial]) -> Trial:
    """Return the trial that the others of its camera are compared with: size M, or the first."""
    camera_trials = [other for other in trials if other.camera == trial.camera]
    return next(
        (o for o in camera_trials if o.size == BASE_SIZE and o.bundle == o.camera), camera_trials[0]
    )

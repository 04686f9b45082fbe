"""Measure how well a bundle restores, beside classical methods, by a fixed protocol.

    python -m tools.quality --tune --bundle duet --data DATA/valid_open
    python -m tools.quality --bundle duet --data DATA/test --resume

writes the JSON (every measurement, all means) and the page beside it (docs/results/quality.*). What
was measured lies in a journal in the work directory; `--resume` measures only what is missing there
or what has changed, so rows, captures and sources of PSFs may be measured in several runs.
"""

import argparse
import json
import shlex
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.errors import CamkitError, ContractError
from camkit.report.bench.machine import processor_name
from camkit.report.fabricated_optics import fabricated_optics, lens_text
from camkit.report.quality import FABRICATION_SEEDS, FIELD_SHARES, Shot, list_set, read_picture
from camkit.runtime.network.engine import available_threads
from tools.capture.simulated import color_sensor
from tools.comparison.copies import transfer_error
from tools.comparison.measurement import (
    CAPTURE_COLUMNS,
    VALUE_COLUMNS,
    Measurement,
    Row,
    append_measurements,
    by_capture,
    finished_rows,
    latest,
    measure_all,
    open_rows,
    read_measurements,
)
from tools.comparison.peers import PEERS
from tools.comparison.photograph import TUNING_SEED, Photograph, photograph
from tools.comparison.quality_table import seconds_per_megapixel, summarise, to_markdown
from tools.comparison.rows import DEFAULT_METHODS, Rival, make_rows, protocol_text
from tools.comparison.tuning import at_edge, choose, try_peers, tuned_from_json, tuned_to_json
from tools.tables.records import to_compact_json

TUNING_SIDE_PX = 272
SIZES = ("S", "M", "L")
DIGITS, CAPTURE_DIGITS = 6, 4


def main() -> None:
    """Run a tuning or a comparison."""
    arguments = parse_arguments()
    cv2.setNumThreads(1)
    try:
        bundle = open_bundle(find_bundle(arguments.bundle))
        if arguments.tune:
            tune(arguments, bundle)
        else:
            compare(arguments, bundle)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--bundle", required=True, help="name or path of the bundle")
    add("--before", metavar="PATH", help="the bundle as it was: its bank and networks beside")
    add("--compare", nargs=2, action="append", default=[], metavar=("PATH", "LABEL"))
    add("--data", type=Path, required=True, help="folder of the sets (with --tune: of pictures)")
    add("--sets", default="kodak_odd,bsd100_half_a,set14,set5")
    add("--per-set", type=int, help="only the first N pictures of a set, by name")
    add("--isos", default="100,1600")
    add("--psf", choices=("fresh", "bundle", "both"), default="both")
    add("--methods", default="", help=f"default: {','.join(DEFAULT_METHODS)} and all sizes")
    add("--tuned", type=Path, help="report that holds the tuned parameters; default: --out")
    add("--prescription", type=Path, help="the lens, if the bundle does not hold it")
    add("--out", type=Path, default=Path("docs/results/quality.json"))
    add("--work-dir", type=Path, default=Path("runs/quality"), help="journal and traced PSFs")
    add("--jobs", type=int, default=1, help="captures at a time")
    add("--limit-seconds", type=float, help="begin no capture after this time")
    add("--resume", action="store_true", help="keep and report what the journal holds")
    add("--places", type=int, default=2, help="with --tune: field positions of every picture")
    add("--tune", action="store_true", help="tune the classical methods on --data")
    return parser.parse_args()


def photographer(arguments: argparse.Namespace, bundle: Bundle) -> Callable[[Shot], Photograph]:
    """Return the function that photographs a shot; PSFs stay in memory."""
    lens = lenses(arguments, bundle)

    def take(shot: Shot) -> Photograph:
        optics = bundle.frozen_optics
        if shot.psf == "fresh":
            optics = lens(TUNING_SEED if arguments.tune else shot.fabrication_seed)
        most_px = TUNING_SIDE_PX if arguments.tune else None
        return photograph(shot, read_picture(shot.picture, most_px), bundle, optics)

    return take


def lenses(arguments: argparse.Namespace, bundle: Bundle) -> Callable[[int], FrozenOptics]:
    """Return the function that traces the copy of a seed, once for all threads."""
    tracing = threading.Lock()

    @lru_cache(maxsize=len(FABRICATION_SEEDS))
    def traced(seed: int) -> FrozenOptics:
        return fabricated_optics(
            bundle,
            seed,
            cache_folder=arguments.work_dir / "psf",
            prescription=arguments.prescription,
        )

    def lens(seed: int) -> FrozenOptics:
        with tracing:
            return traced(seed)

    return lens


def tune(arguments: argparse.Namespace, bundle: Bundle) -> None:
    """Choose the parameters of the peers on development pictures, each at `--places` places."""
    take = photographer(arguments, bundle)
    pictures = list_set(arguments.data, arguments.per_set)
    peers = [name for name in chosen_methods(arguments, bundle) if name in PEERS]
    shots = [
        Shot(
            set_name=arguments.data.name,
            picture=picture,
            number=number,
            position=(number + step) % len(FIELD_SHARES),
            iso=iso,
            psf="fresh",
        )
        for number, picture in enumerate(pictures)
        for step in range(0, 2 * arguments.places, 2)
        for iso in isos_of(arguments)
    ]
    trials = []
    began = time.perf_counter()
    with ThreadPoolExecutor(max_workers=arguments.jobs) as pool:
        trials_of_shots = pool.map(lambda shot: try_peers(take(shot), bundle, peers), shots)
        for number, trials_of_shot in enumerate(trials_of_shots, start=1):
            trials += trials_of_shot
            print(
                f"{number}/{len(shots)} captures, {time.perf_counter() - began:.0f} s", flush=True
            )
    tuned, curves = choose(trials)
    for peer, by_iso in tuned.items():
        for iso, setting in by_iso.items():
            edges = at_edge(peer, setting)
            edge = f"  AT THE EDGE of the candidates: {', '.join(edges)}" if edges else ""
            print(f"{peer}: {PEERS[peer].describe(setting)} at ISO {iso:g}{edge}")
    report = read_report(arguments.out)
    report["tuned"] = {
        "data": arguments.data.name,
        "fabrication_seed": TUNING_SEED,
        "captures": len(shots),
        "bundle_sha256": bundle.sha256,
        "values": tuned_to_json(tuned),
        "psnr_db": curves,
    }
    write_report(arguments.out, report)


def compare(arguments: argparse.Namespace, bundle: Bundle) -> None:
    """Measure all rows on all captures and write the report."""
    earlier = read_report(arguments.out)
    source = arguments.tuned or arguments.out
    tuned = read_report(source).get("tuned")
    if tuned is None:
        raise ContractError(f"{source} holds no tuned parameters; run with --tune first")
    methods = chosen_methods(arguments, bundle)
    rivals = [
        Rival(bundle=open_bundle(find_bundle(path)), label=label)
        for path, label in arguments.compare
    ]
    rows = make_rows(
        bundle,
        methods,
        rivals,
        tuned_from_json(tuned["values"]),
        isos_of(arguments),
        lens_text(bundle, arguments.prescription),
        open_bundle(find_bundle(arguments.before)) if arguments.before else None,
    )
    journal = arguments.work_dir / f"{arguments.out.stem}.jsonl"
    if not arguments.resume:
        journal.unlink(missing_ok=True)
    measure_missing(arguments, bundle, rows, journal)
    current = {(row.name, row.identity) for row in rows}
    # what an earlier run measured counts too, as long as nothing that decides it has changed
    measurements = latest(
        m for m in read_measurements(journal) if (m.method, m.identity) in current
    )
    commands = earlier.get("commands", []) if arguments.resume else []
    command = f"python -m tools.quality {shlex.join(sys.argv[1:])}"
    names = [row.name for row in rows]
    report = {
        "commands": [*(c for c in commands if c != command), command],
        "json_name": arguments.out.name,
        "machine": {"cpu": processor_name(), "cores": available_threads()},
        "earlier_runs": earlier.get("earlier_runs", {}) if arguments.resume else {},
        "bundle": {"name": bundle.manifest.name, "sha256": bundle.sha256},
        "rivals": {rival.label: rival.bundle.sha256 for rival in rivals},
        "tuned": tuned,
        "protocol": {"text": protocol_text(bundle, isos_of(arguments))},
        "methods": names,
        "seconds_per_megapixel": seconds_per_megapixel(measurements),
        "copies": errors_of_copies(arguments, bundle, measurements),
        "summary": summarise(measurements, names),
        "identities": {row.name: row.identity for row in rows},
        "columns": {"capture": CAPTURE_COLUMNS, "method": VALUE_COLUMNS},
        "captures": by_capture(measurements, names),
    }
    write_report(arguments.out, report)
    arguments.out.with_suffix(".md").write_text(to_markdown(report), encoding="utf-8")
    show_result(report)


def errors_of_copies(
    arguments: argparse.Namespace, bundle: Bundle, measurements: Sequence[Measurement]
) -> dict[str, float]:
    """Return seed -> how far the copy's transfer lies off the frozen one, of those measured."""
    sensor = color_sensor(bundle)
    seeds = sorted({m.seed for m in measurements if m.seed is not None})
    lens = lenses(arguments, bundle)
    errors = {seed: transfer_error(bundle.psf, lens(seed).psf, sensor) for seed in seeds}
    return {str(seed): round(error, 3) for seed, error in errors.items()}


def measure_missing(
    arguments: argparse.Namespace, bundle: Bundle, rows: Sequence[Row], journal: Path
) -> None:
    """Measure what the journal lacks and add it there."""
    shots = list_shots(arguments)
    done = finished_rows(read_measurements(journal))
    work = [(shot, open_methods) for shot in shots if (open_methods := open_rows(shot, rows, done))]
    print(f"{len(shots)} captures, {len(work)} to do, {len(rows)} methods", flush=True)
    take = photographer(arguments, bundle)
    began = time.perf_counter()
    finished = measure_all(work, take, jobs=arguments.jobs, limit_s=arguments.limit_seconds)
    for number, measurements in enumerate(finished, start=1):
        append_measurements(journal, measurements)
        if number in (3, 10) or number % 25 == 0 or number == len(work):
            show_pace(measurements, number, len(work), time.perf_counter() - began)


def chosen_methods(arguments: argparse.Namespace, bundle: Bundle) -> list[str]:
    """Return the methods asked for, or the usual ones and every size that the bundle holds."""
    if arguments.methods:
        return str(arguments.methods).split(",")
    return [*DEFAULT_METHODS, *(size for size in SIZES if size in bundle.manifest.sizes)]


def isos_of(arguments: argparse.Namespace) -> list[float]:
    """Return the sensitivities that were asked for."""
    return [float(iso) for iso in arguments.isos.split(",")]


def list_shots(arguments: argparse.Namespace) -> list[Shot]:
    """Return all captures, those of the first picture of every set first: a part is a fair part."""
    sources: Sequence[Any] = ("fresh", "bundle") if arguments.psf == "both" else (arguments.psf,)
    shots = [
        Shot(
            set_name=name,
            picture=picture,
            number=number,
            position=position,
            iso=iso,
            psf=source,
        )
        for name in arguments.sets.split(",")
        for number, picture in enumerate(list_set(arguments.data / name, arguments.per_set))
        for position in range(len(FIELD_SHARES))
        for iso in isos_of(arguments)
        for source in sources
    ]
    return sorted(shots, key=lambda shot: (shot.number, shot.position))


def show_pace(measurements: list[Measurement], number: int, count: int, elapsed_s: float) -> None:
    """Print how far a run is and what it costs."""
    left_min = elapsed_s / number * (count - number) / 60
    each = f"{elapsed_s / number:.2f} s ({time.process_time() / number:.2f} s of processor) each"
    costs = ", ".join(f"{m.method} {m.seconds:.2f}" for m in measurements)
    print(f"{number}/{count}, {each}, {left_min:.0f} min left; {costs}")
    sys.stdout.flush()


def show_result(report: dict[str, Any]) -> None:
    """Print the means."""
    for psf, summary in report["summary"].items():
        print(f"\n{psf}: " + json.dumps(summary["gain_of_m"]))
        for name, mean in summary["overall"].items():
            print(f"  {name:>16} {mean['psnr_db']:7.2f} dB  {mean['ssim']:.4f}  n {mean['n']}")


def read_report(path: Path) -> dict[str, Any]:
    """Read the report of an earlier run; empty without one."""
    if not path.exists():
        return {}
    report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return report


def write_report(path: Path, report: dict[str, Any]) -> None:
    """Write the report; a line per entry and capture keeps it small and its changes few."""
    path.parent.mkdir(parents=True, exist_ok=True)
    entries = {k: to_compact_json(v, DIGITS) for k, v in report.items() if k != "captures"}
    if "captures" in report:
        lines = ",\n".join(to_compact_json(row, CAPTURE_DIGITS) for row in report["captures"])
        entries["captures"] = f"[\n{lines}\n]"
    text = ",\n".join(f"{json.dumps(k)}:{entry}" for k, entry in entries.items())
    part = path.with_suffix(".json.part")
    part.write_text(f"{{{text}}}\n", encoding="utf-8")
    part.replace(path)


if __name__ == "__main__":
    main()

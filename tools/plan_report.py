"""Calibrate what `--quality adaptive` may skip, and prove it on scenes it never saw.

    python -m tools.plan_report calibrate --bundle duet --data DATA/train_open --out plan.json
    python -m tools.plan_report calibrate ... --write camkit/bundles/duet.camkit
    python -m tools.plan_report report --bundle duet --data DATA --out-dir out/plan
    python -m tools.plan_report oracle --bundle duet --data DATA

`calibrate` simulates captures of pictures and procedural scenes, measures per lattice cell what
less than the exact result loses, fits the loss model and writes it as the manifest's `plan`:
into a JSON file, which `camkit export --plan` takes, and with --write into a bundle.
`report` measures saving and loss on the scenes of tools/plan/scenes.py; `oracle` computes on the
same scenes what could be saved if the loss of every cell were known beforehand.
"""

import argparse
import itertools
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.manifest import Threshold
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.report.quality import list_set, read_picture
from camkit.runtime.plan.loss import EXACT, plan_entries, read_loss_model
from camkit.runtime.plan.rules.size import REFERENCE
from camkit.runtime.plan.tiers import TierWork
from tools.plan.cells import CaptureCells, measure_cells, photograph, pipelines
from tools.plan.fit import Calibration, fit_model
from tools.plan.oracle import oracle_saving, plan_saving, summary_line
from tools.plan.proof import ISOS as PROOF_ISOS
from tools.plan.proof import prove, write_report
from tools.plan.scenes import GENERATORS, ProofScene, proof_scenes

ISOS = (100.0, 400.0, 1600.0)
SIDE_PX = 1280
PROCEDURAL_SEED = 8_000_000
"""Seeds from here on are used by no training and by no report."""


def main() -> int:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    calibrate = commands.add_parser("calibrate", help="fit and store the loss model")
    calibrate.add_argument("--bundle", default="duet", help="name or path")
    calibrate.add_argument("--data", type=Path, help="folder of sharp pictures (train_open)")
    calibrate.add_argument("--pictures", type=int, default=24, help="how many of them")
    calibrate.add_argument("--procedural", type=int, default=25, help="generated scenes besides")
    calibrate.add_argument("--out", type=Path, help="JSON file for `camkit export --plan`")
    calibrate.add_argument("--write", type=Path, help="bundle to store the plan in")
    report = commands.add_parser("report", help="saving and loss on unseen scenes")
    oracle = commands.add_parser("oracle", help="what could be saved, and what the plan saves")
    for command in (report, oracle):
        _add_scenes(command)
    report.add_argument("--out-dir", type=Path, default=Path("out/plan"))
    report.add_argument("--quality", default="adaptive", choices=("adaptive", "draft"))
    report.add_argument("--runs", type=int, default=1, help="timed runs per capture and quality")
    options = parser.parse_args()
    run = {"calibrate": _calibrate, "report": _report, "oracle": _oracle}
    return run[options.command](options)


def _add_scenes(command: argparse.ArgumentParser) -> None:
    command.add_argument("--bundle", default="duet", help="name or path")
    command.add_argument(
        "--data", type=Path, help="folder with valid_open and hdr; none: procedural"
    )
    command.add_argument("--width", type=int, default=2048, help="of procedural scenes")
    command.add_argument("--height", type=int, default=1536, help="of procedural scenes")
    command.add_argument("--limit", type=int, default=0, help="only so many scenes")
    command.add_argument("--kinds", default="", help="only these kinds, with commas")


def _calibrate(options: argparse.Namespace) -> int:
    bundle = open_bundle(find_bundle(options.bundle))
    work, small = _work(bundle)
    began = time.process_time()
    captures = []
    targets = pipelines(bundle)
    for number, (name, scene) in enumerate(_scenes(options)):
        iso = ISOS[number % len(ISOS)]
        simulation = photograph(bundle, scene, number=number, iso=iso)
        captures.append(measure_cells(bundle, targets, f"{name} ISO {iso:g}", simulation))
        cpu_s = time.process_time() - began
        print(f"{number + 1:3d} {captures[-1].name}: {cpu_s:.0f} CPU s", file=sys.stderr)
    calibration = fit_model(captures, work, small)
    entries = plan_entries(
        calibration.model,
        adaptive_cost_db=calibration.adaptive[0],
        draft_cost_db=calibration.draft[0],
    )
    _print_calibration(calibration, captures)
    for target in calibration.model.lines:
        sums = [c.errors[target].sum() / c.errors[EXACT].sum() for c in captures]
        print(f"{target} everywhere loses {np.mean(10 * np.log10(sums)):.2f} dB")
    if options.out is not None:
        text = json.dumps({k: v.model_dump() for k, v in sorted(entries.items())}, indent=2)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(text + "\n", encoding="utf-8")
    if options.write is not None:
        _store(options.write, entries)
    return 0


def _scenes(options: argparse.Namespace) -> Iterator[tuple[str, FloatArray]]:
    """Return names and (3, h, w) scenes with even sides, pictures spread over the folder."""
    if options.data is not None:
        paths = list_set(options.data)
        indices = np.unique(np.linspace(0, len(paths) - 1, options.pictures).astype(int))
        for index in indices:
            picture = read_picture(paths[index], SIDE_PX)
            height, width = (side // 2 * 2 for side in picture.shape[1:])
            yield paths[index].name, np.ascontiguousarray(picture[:, :height, :width])
    for index in range(options.procedural):
        # One subject after the other: in turn, one would meet the same place in the field always.
        subject, generator = list(GENERATORS.items())[index * len(GENERATORS) // options.procedural]
        seed = PROCEDURAL_SEED + index
        yield f"{subject}:{seed}", generator(seed, 1024, 1024)


def _work(bundle: Bundle) -> tuple[TierWork, str | None]:
    """Return what the tiers cost in this bundle, and its smallest size below the reference.

    Raises:
        ContractError: If it has not one network.
    """
    roles = tuple(bundle.manifest.networks)
    if len(roles) != 1:
        raise ContractError(
            f"cells are shared among the sizes of one network; {bundle.manifest.name} has "
            f"{', '.join(roles) or 'none'}"
        )
    full = bundle.network_facts(roles[0], REFERENCE)
    small = next(iter(bundle.manifest.sizes))
    facts = None if small == REFERENCE else bundle.network_facts(roles[0], small)
    work = TierWork(
        full_mac=full.mac_per_pixel,
        full_halo_px=full.reach_px,
        small_mac=None if facts is None else facts.mac_per_pixel,
        small_halo_px=0 if facts is None else facts.reach_px,
    )
    return work, None if facts is None else small


def _store(path: Path, entries: dict[str, Threshold]) -> None:
    """Write the plan into a bundle; every other byte of its content stays."""
    bundle = open_bundle(path)
    members = {name: bundle.member(name) for name in bundle.names}
    write_bundle(path, bundle.manifest.model_copy(update={"plan": entries}), members)
    print(f"wrote the plan into {path}")


def _print_calibration(calibration: Calibration, captures: list[CaptureCells]) -> None:
    print(f"{len(captures)} captures, {calibration.cells} cells")
    for target, line in calibration.model.lines.items():
        level, detail, noise, field = line
        print(
            f"{target:8s} level {level:7.2f}  detail {detail:5.2f}  noise {noise:5.2f}  "
            f"field {field:5.2f}  spread {calibration.spread[target]:.2f}"
        )
    for name, value, (mean, worst) in (
        ("adaptive", calibration.model.adaptive_db, calibration.adaptive),
        ("draft", calibration.model.draft_db, calibration.draft),
    ):
        print(f"{name}: predicted {value:.3f} dB, lost {mean:.3f} dB mean, {worst:.3f} dB worst")


def _report(options: argparse.Namespace) -> int:
    bundle = open_bundle(find_bundle(options.bundle))
    rows = []
    for row in prove(bundle, _proof_scenes(options), quality=options.quality, runs=options.runs):
        rows.append(row)
        print(row.line(), flush=True)
    for line in write_report(rows, bundle, options.out_dir):
        print(line)
    return 0


def _proof_scenes(options: argparse.Namespace) -> Iterator[ProofScene]:
    subjects = tuple(name for name in options.kinds.split(",") if name)
    scenes = proof_scenes(options.height, options.width, options.data, subjects)
    return itertools.islice(scenes, options.limit) if options.limit else scenes


def _oracle(options: argparse.Namespace) -> int:
    bundle = open_bundle(find_bundle(options.bundle))
    model = read_loss_model(bundle.manifest.plan)
    work, small = _work(bundle)
    if model is None or small is None:
        raise ContractError(f"{bundle.manifest.name} has no calibrated plan, or one size alone")
    targets, oracles, plans = pipelines(bundle), [], []
    for number, scene in enumerate(_proof_scenes(options)):
        iso = PROOF_ISOS[number % len(PROOF_ISOS)]
        simulation = photograph(bundle, scene.make(), number=number, iso=iso)
        cells = measure_cells(bundle, targets, scene.name, simulation)
        oracles.append(oracle_saving(cells, bundle, work, small))
        plans.append(plan_saving(cells, bundle, work, small, model))
        print(summary_line("oracle", oracles), flush=True)
        print(summary_line("plan", plans), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

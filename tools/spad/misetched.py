"""What calibration and fine-tuning win back on a plate that was etched wrong, in simulation.

    python -m tools.spad.misetched --checkpoint M.pt --data PICTURES --valid VALIDATION --test TESTS
        --out-dir out/misetched

The PSF that comes with camkit is matched by a plate of 8 levels, as `camkit plate match` does it.
Its masks etch too deep by a share, a point is photographed through it, the PSF is measured on the
photographs as `camkit calibrate psf --dots` does it, and the network is trained on behind that.
Judged on the test sets, at three levels of light:

plate as designed   the network as it is; the linear estimate told the design
plate as etched     the same two, then what knows better: the network trained on with the measured
                    PSF; the linear estimate told the measured PSF, and the true one
                    with --control also the network trained on as long with the designed PSF

Behind a plate as etched the light always goes through its true PSF. A scan of errors tells the
loss without noise. A training that is done in --out-dir is not done again. Pictures are worked on
by one thread.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from camkit.contracts import FloatArray
from camkit.errors import CamkitError, ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf, write_plate_psf
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.optics.diffraction.plate import PLATES
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.target import likeness
from camkit.models_def.optics.dots.unit import DotPlate
from camkit.models_def.training.checkpoint import Checkpoint, load_network, read_checkpoint
from camkit.report.bench.machine import describe_machine
from camkit.runtime.output.part_file import atomic_output
from tools.comparison.compact_json import to_compact_json
from tools.spad.misetch.photograph import measured_psf
from tools.spad.misetch.plate import LEVELS, Etched, etched, matched_plate
from tools.spad.misetch.scores import LEVELS as LIGHT
from tools.spad.misetch.scores import (
    Method,
    Sets,
    linear_method,
    network_method,
    read_sets,
    scored,
    scored_levels,
)
from tools.spad.misetch.text import misetched_text
from tools.spad.misetch.tuning import Tuning, tuned

PSF: Final = PLATES / "spad-sr.safetensors"
SCAN: Final = (-0.1, -0.06, -0.03, 0.03, 0.06, 0.1)
DIGITS: Final = 7
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Etch, measure, train and judge; print tables and write JSON.

    Raises:
        SystemExit: If something is missing or does not fit; says what.
    """
    options = _parser().parse_args(arguments)
    torch.set_num_threads(1)
    try:
        record = _record(options)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    path = options.out_dir / "misetched.json"
    with atomic_output(path) as part:
        part.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(misetched_text(record))
    print(path)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--checkpoint", type=Path, required=True, help="network of the designed PSF")
    add("--data", type=Path, help="pictures to train on; without them procedural scenes alone")
    add("--valid", type=Path, help="pictures to validate on")
    add("--test", type=Path, required=True, help="folder of the test sets")
    add("--out-dir", type=Path, required=True)
    add("--cpu-minutes", type=float, default=3.0, help="of training on")
    add("--depth-error", type=float, default=0.06, help="of every mask, a share of its depth")
    add("--psf", type=Path, default=PSF, help="that the plate is made for")
    add("--control", action="store_true", help="train on with the designed PSF, too")
    add("--cells", type=int, default=DotCamera().cells)
    add("--tiles", type=int, default=DotCamera().tiles)
    return parser


def _record(options: argparse.Namespace) -> Row:
    designed, checkpoint = read_plate_psf(options.psf), read_checkpoint(options.checkpoint)
    if checkpoint.bank_digest != SpadMaterial(kernel=designed).digest():
        raise ContractError(f"{options.checkpoint} was not trained behind the PSF {options.psf}")
    if not abs(options.depth_error) < 1:
        raise ContractError(f"--depth-error is a share of a depth; got {options.depth_error:g}")
    sets = read_sets(options.test)
    plate = matched_plate(designed, DotCamera(cells=options.cells, tiles=options.tiles))
    right, wrong = etched(plate, 0.0), etched(plate, options.depth_error)
    folder = options.out_dir / "measured"
    psf, seen = measured_psf(wrong.height_um, plate.camera, designed, folder)
    measured = read_plate_psf(psf)
    _tell(f"measured: like the true PSF by {_apart(measured, wrong)}")
    trainings: Row = {}
    rows = [
        {"plate": plate_name, "method": method_name, "scores": scores}
        for plate_name, method_name, scores in (
            *_untrained(sets, right, wrong, designed, measured, checkpoint),
            *_trained(sets, wrong, psf, options, checkpoint, trainings),
        )
    ]
    return {
        "machine": describe_machine(),
        "psf": options.psf.stem,
        "levels": LEVELS,
        "depth_error": options.depth_error,
        "as_designed": right.like(designed),
        "as_etched": wrong.like(designed),
        "measured": {**_apart(measured, wrong), **seen.to_json()},
        "trainings": trainings,
        "pictures": {name: len(pictures) for name, pictures in sets.items()},
        "photons": list(LIGHT),
        "rows": rows,
        "scan": list(_scan(sets, plate, designed, checkpoint)),
    }


def _apart(measured: FloatArray, true: Etched) -> Row:
    """Give how a measured PSF is like the true one."""
    found = likeness(measured.astype(np.float64), true.seen)
    return {"correlation": round(found.correlation, 7), "rmse": round(found.rmse, 6)}


def _untrained(
    sets: Sets,
    right: Etched,
    wrong: Etched,
    designed: FloatArray,
    measured: FloatArray,
    checkpoint: Checkpoint,
) -> Iterator[tuple[str, str, Row]]:
    network = network_method(load_network(checkpoint))
    told = {
        name: linear_method(make_sampling("learned", kernel=kernel))
        for name, kernel in (("design", designed), ("measured", measured), ("true", wrong.kernel))
    }
    methods: list[tuple[str, Etched, str, Method]] = [
        ("designed", right, "network", network),
        ("designed", right, "linear, told the design PSF", told["design"]),
        ("etched", wrong, "network", network),
        *(("etched", wrong, f"linear, told the {name} PSF", told[name]) for name in told),
    ]
    for plate, made, name, method in methods:
        _tell(f"{plate}: {name}")
        yield plate, name, scored_levels(sets, made.sampling, method)


def _trained(
    sets: Sets,
    wrong: Etched,
    psf: Path,
    options: argparse.Namespace,
    checkpoint: Checkpoint,
    trainings: Row,
) -> Iterator[tuple[str, str, Row]]:
    """Train on, note how that ended, and judge behind the true PSF."""
    files = {"measured": psf}
    if options.control:
        files["design"] = options.out_dir / "design" / "design.safetensors"
        files["design"].parent.mkdir(parents=True, exist_ok=True)
        write_plate_psf(files["design"], read_plate_psf(options.psf))
    tuning = Tuning(pictures=options.data, valid=options.valid, cpu_minutes=options.cpu_minutes)
    for name, file in files.items():
        _tell(f"training on with the {name} PSF for {options.cpu_minutes:g} CPU-minutes")
        kernel = read_plate_psf(file)
        out, ended = tuned(options.checkpoint, checkpoint, file, kernel, tuning)
        trainings[name] = {"cpu_minutes": options.cpu_minutes, **ended}
        _tell(f"{name}: {ended}")
        network = network_method(load_network(read_checkpoint(out)))
        yield (
            "etched",
            f"network, trained on with the {name} PSF",
            scored_levels(sets, wrong.sampling, network),
        )


def _scan(
    sets: Sets, plate: DotPlate, designed: FloatArray, checkpoint: Checkpoint
) -> Iterator[Row]:
    """Give the loss without noise of masks that are wrong by less and more."""
    network = network_method(load_network(checkpoint))
    told = linear_method(make_sampling("learned", kernel=designed))
    for error in SCAN:
        _tell(f"scan: {error:+.0%}")
        made = etched(plate, error)
        methods = {
            "network": network,
            "linear_design": told,
            "linear_true": linear_method(made.sampling),
        }
        yield {
            "depth_error": error,
            "like_design": made.like(designed),
            **{name: scored(sets, made.sampling, m, math.inf) for name, m in methods.items()},
        }


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())

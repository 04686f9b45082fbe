"""What calibration and fine-tuning win back on a plate that was etched wrong, in simulation.

    python -m tools.spad.misetched --checkpoint M.pt --data PICTURES --valid VALIDATION --test TESTS
        --out-dir out/misetched [--cpu-minutes 3] [--depth-error 0.06 -0.4] [--control]

The PSF that comes with camkit is matched by a plate of 8 levels, as `camkit plate match` does it.
Its masks etch too deep by a share, a point is photographed through it, the PSF is measured on the
photographs as `camkit calibrate psf --dots` does it, and the network is trained on behind that.
Judged on the test sets, at three levels of light:

plate as designed   the network as it is; the linear estimate told the design
plates as etched    the same two, then what knows better: the network trained on with the measured
                    PSF; the linear estimate told the measured PSF, and the true one
                    with --control also the network trained on as long with the designed PSF

Behind a plate as etched the light always goes through its true PSF. A scan of errors tells the
loss without noise. A training that is done in --out-dir is not done again. Pictures are worked on
by one thread.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import CamkitError, ContractError
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.training import SpadMaterial
from camkit.models_def.optics.diffraction.plate import PLATES
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.training.checkpoint import read_checkpoint
from camkit.report.bench.machine import describe_machine
from camkit.runtime.output.part_file import atomic_output
from tools.comparison.compact_json import to_compact_json
from tools.spad.misetch.judging import Trial, as_designed, as_etched, control_of, scan
from tools.spad.misetch.plate import LEVELS, matched_plate
from tools.spad.misetch.scores import LEVELS as LIGHT
from tools.spad.misetch.scores import read_sets
from tools.spad.misetch.text import misetched_text
from tools.spad.misetch.tuning import Tuning, ending

PSF: Final = PLATES / "spad-sr.safetensors"
DEPTH_ERRORS: Final = (0.06, -0.4)
SCAN: Final = (-0.4, -0.3, -0.2, -0.1, -0.06, -0.03, 0.03, 0.06, 0.1, 0.2, 0.3, 0.4)
DIGITS: Final = 7


def main(arguments: Sequence[str] | None = None) -> int:
    """Etch, measure, train and judge; print tables and write JSON.

    Raises:
        SystemExit: If something is missing or does not fit; says what.
    """
    options = _parser().parse_args(arguments)
    torch.set_num_threads(1)
    try:
        record = _record(_trial(options), options)
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
    add("--cpu-minutes", type=float, default=3.0, help="of training on, for each PSF")
    add(
        "--depth-error",
        type=float,
        nargs="+",
        default=list(DEPTH_ERRORS),
        help="of every mask, a share of its depth; a plate for each",
    )
    add("--psf", type=Path, default=PSF, help="that the plate is made for")
    add("--control", action="store_true", help="train on with the designed PSF, too")
    add("--cells", type=int, default=DotCamera().cells)
    add("--tiles", type=int, default=DotCamera().tiles)
    return parser


def _trial(options: argparse.Namespace) -> Trial:
    """Read everything and make the plate.

    Raises:
        ContractError: If something does not fit.
    """
    designed, checkpoint = read_plate_psf(options.psf), read_checkpoint(options.checkpoint)
    if checkpoint.bank_digest != SpadMaterial(kernel=designed).digest():
        raise ContractError(f"{options.checkpoint} was not trained behind the PSF {options.psf}")
    if wrong := [error for error in options.depth_error if not abs(error) < 1]:
        raise ContractError(f"--depth-error is a share of a depth; got {wrong[0]:g}")
    sets = read_sets(options.test)
    camera = DotCamera(cells=options.cells, tiles=options.tiles)
    return Trial(
        sets=sets,
        plate=matched_plate(designed, camera),
        designed=designed,
        start=options.checkpoint,
        checkpoint=checkpoint,
        tuning=Tuning(pictures=options.data, valid=options.valid, cpu_minutes=options.cpu_minutes),
        folder=options.out_dir,
    )


def _record(trial: Trial, options: argparse.Namespace) -> dict[str, Any]:
    control = control_of(trial) if options.control else None
    return {
        "machine": describe_machine(),
        "psf": options.psf.stem,
        "levels": LEVELS,
        "pictures": {name: len(pictures) for name, pictures in trial.sets.items()},
        "photons": list(LIGHT),
        "cpu_minutes": options.cpu_minutes,
        "designed": as_designed(trial),
        "control": None if control is None else ending(control),
        "scan": list(scan(trial, SCAN)),
        "etched": [as_etched(trial, error, control) for error in options.depth_error],
    }


if __name__ == "__main__":
    sys.exit(main())

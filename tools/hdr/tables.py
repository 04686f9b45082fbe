"""Tables 5.4 and 5.5: which optics, read by which network, bring clipped lights back?

    python -m tools.hdr.tables train --out-dir out/tables --data PICTURES
    python -m tools.hdr.tables measure --runs out/tables --data HDR -o docs/results/hdr-tables.json

`train` trains every network of the tables for the same CPU time, one after the other; stopped, it
goes on where it was. Rows with the networks of the thesis need weights of VGG-19 (`--vgg FILE`) and
are left out without. `measure` photographs night scenes and the HDR pictures of a folder as
`camkit bench --saturate 0.015` does (mosaics, ISO 100, 12 bits), measures every row that is trained
and prints the tables; what was measured before is not measured again. `--rows` names some rows.

References: Sun 2021, tables 5.4 and 5.5.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import torch

from camkit.errors import CamkitError, ContractError
from camkit.runtime.output.part_file import atomic_output
from tools.comparison.compact_json import to_compact_json
from tools.comparison.equal_training import EqualTime
from tools.hdr.table.measuring import measure_rows
from tools.hdr.table.record import record_of
from tools.hdr.table.rows import LDR, ROWS, chosen_rows
from tools.hdr.table.text import tables_text
from tools.hdr.table.training import TrainSettings, finished, train_rows

DIGITS = 6
NIGHTS = 33


def main(words: Sequence[str] | None = None) -> None:
    """Train or measure.

    Raises:
        SystemExit: If something is missing; says what.
    """
    arguments = _parser().parse_args(words)
    try:
        arguments.run(arguments)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    train = commands.add_parser("train", help="the networks of the tables")
    train.set_defaults(run=_train)
    train.add_argument("--out-dir", type=Path, required=True, help="a folder for every run")
    train.add_argument("--data", type=Path, help="pictures; without them night scenes alone")
    train.add_argument("--cpu-minutes", type=float, default=15.0, help="for each, samples included")
    train.add_argument("--vgg", type=Path, help="weights of VGG-19 (torchvision's vgg19)")
    train.add_argument("--workers", type=int, default=1, help="processes that make samples")
    measure = commands.add_parser("measure", help="every row that is trained")
    measure.set_defaults(run=_measure)
    measure.add_argument("--runs", type=Path, required=True, help="the --out-dir of train")
    measure.add_argument("-o", "--output", type=Path, required=True, help="the record (JSON)")
    measure.add_argument("--data", type=Path, help="folder of HDR pictures (EXR, HDR)")
    measure.add_argument(
        "--scenes", type=int, default=NIGHTS, help="night scenes with LDR <= 45 dB"
    )
    measure.add_argument("--overwrite", action="store_true", help="write over a record")
    for command in (train, measure):
        command.add_argument(
            "--rows", nargs="+", metavar="ROW", help=f"of {', '.join(row.key for row in ROWS)}"
        )
    return parser


def _train(arguments: argparse.Namespace) -> None:
    time = EqualTime(
        out_dir=arguments.out_dir,
        pictures=arguments.data,
        cpu_minutes=arguments.cpu_minutes,
        workers=arguments.workers,
    )
    settings = TrainSettings(time=time, vgg=arguments.vgg)
    train_rows(chosen_rows(arguments.rows), settings, _tell)


def _measure(arguments: argparse.Namespace) -> None:
    out: Path = arguments.output
    if out.exists() and not arguments.overwrite:
        raise ContractError(f"{out} is there already: give --overwrite")
    if not out.parent.is_dir():
        raise ContractError(f"there is no folder {out.parent} for the record")
    if arguments.scenes < 1:
        raise ContractError(f"--scenes must be >= 1; got {arguments.scenes}")
    torch.set_num_threads(1)
    asked = chosen_rows(arguments.rows)
    rows = asked if LDR in asked else (LDR, *asked)
    found = measure_rows(rows, arguments.runs, arguments.scenes, arguments.data, _tell)
    trained = {
        run.name: ended
        for row in rows
        for run in row.runs
        if (ended := finished(arguments.runs, run)) is not None
    }
    record = record_of(rows, found, trained)
    with atomic_output(out) as part:
        part.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(tables_text(record))


def _tell(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    main()

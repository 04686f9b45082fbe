"""Tables 4.1 and 4.2: pictures of a 64x32 array, by how it samples and what makes them finer.

    python -m tools.spad.tables train --out-dir out/spad-tables --data PICTURES --valid VALIDATION
    python -m tools.spad.tables measure --runs out/spad-tables --data TESTS -o RECORD.json

`train` trains every network of the tables for the same CPU time, one after the other; stopped, it
goes on where it was. `--rows` names some rows, SAMPLING.SIZE, or trainings, SAMPLING.SIZE-SEED.
`measure` judges every row that is trained on the sets in a folder (set5, set14, bsd100_half_a), at
four levels of light, beside bicubic interpolation and the linear estimate, and prints the tables;
what was measured before is not measured again.

References: Sun 2021, tables 4.1 and 4.2.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import torch

from camkit.errors import CamkitError, ContractError
from camkit.runtime.output.part_file import atomic_output
from tools.comparison.compact_json import to_compact_json
from tools.spad.table.judged import JUDGED, chosen_judged
from tools.spad.table.measuring import measure_rows
from tools.spad.table.record import record_of
from tools.spad.table.rows import ROWS, chosen_runs
from tools.spad.table.text import tables_text
from tools.spad.table.training import Pictures, ended, train_runs

DIGITS = 6


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
    train.add_argument("--data", type=Path, help="pictures; without them procedural scenes alone")
    train.add_argument("--valid", type=Path, help="pictures to choose by")
    train.add_argument("--cpu-minutes", type=float, default=15.0, help="for each, samples included")
    train.add_argument(
        "--rows", nargs="+", metavar="ROW", help=f"of {', '.join(row.key for row in ROWS)}"
    )
    measure = commands.add_parser("measure", help="every row that is trained")
    measure.set_defaults(run=_measure)
    measure.add_argument("--runs", type=Path, required=True, help="the --out-dir of train")
    measure.add_argument("--data", type=Path, required=True, help="folder of the test sets")
    measure.add_argument("-o", "--output", type=Path, required=True, help="the record (JSON)")
    measure.add_argument("--overwrite", action="store_true", help="write over a record")
    measure.add_argument(
        "--pictures", type=Path, help="those trained on, for the Gaussian where none is trained"
    )
    measure.add_argument(
        "--rows", nargs="+", metavar="ROW", help=f"of {', '.join(row.key for row in JUDGED)}"
    )
    return parser


def _measure(arguments: argparse.Namespace) -> None:
    out: Path = arguments.output
    if out.exists() and not arguments.overwrite:
        raise ContractError(f"{out} is there already: give --overwrite")
    if not out.parent.is_dir():
        raise ContractError(f"there is no folder {out.parent} for the record")
    torch.set_num_threads(1)
    rows = chosen_judged(arguments.rows)
    found = measure_rows(rows, arguments.runs, arguments.data, _tell, arguments.pictures)
    trained = {
        row.trained.run(seed): known
        for row in rows
        if row.trained is not None
        for seed in row.seeds
        if (known := ended(arguments.runs, row.trained, seed)) is not None
    }
    record = record_of(rows, found, trained)
    with atomic_output(out) as part:
        part.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")
    print(tables_text(record))


def _train(arguments: argparse.Namespace) -> None:
    train_runs(
        chosen_runs(arguments.rows),
        arguments.out_dir,
        Pictures(train=arguments.data, valid=arguments.valid),
        arguments.cpu_minutes,
        _tell,
    )


def _tell(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    main()

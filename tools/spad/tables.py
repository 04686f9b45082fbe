"""Tables 4.1 and 4.2: pictures of a 64x32 array, by how it samples and what makes them finer.

    python -m tools.spad.tables train --out-dir out/spad-tables --data PICTURES --valid VALIDATION

`train` trains every network of the tables for the same CPU time, one after the other; stopped, it
goes on where it was. `--rows` names some rows, SAMPLING.SIZE, or trainings, SAMPLING.SIZE-SEED.

References: Sun 2021, tables 4.1 and 4.2.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from camkit.errors import CamkitError
from tools.spad.table.rows import ROWS, chosen_runs
from tools.spad.table.training import Pictures, train_runs


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
    return parser


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

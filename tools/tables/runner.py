"""The command line of all tables, and what they share: equal times, a journal, a record.

    python -m tools.tables hdr train --out-dir out/tables --data PICTURES
    python -m tools.tables hdr measure --runs out/tables --data HDR -o docs/results/hdr-tables.json

`train` trains every network of a table for the same CPU time, one after the other; stopped, it goes
on where it was. `measure` measures every row that is trained, prints the tables and writes their
record; what was measured before is not measured again. `--rows` names some rows.
"""

import argparse
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import CamkitError, ContractError
from camkit.runtime.output.part_file import atomic_output
from tools.tables.equal_training import EqualTime, Tell, Trainee, finished, trained
from tools.tables.journal import Entry, Journal
from tools.tables.records import to_compact_json
from tools.tables.table_rows import Row, Run, chosen_trainings

JOURNAL: Final = "measured.jsonl"

Record = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A table's order to measure.

    Attributes:
        options: Of the command line, those of the table too.
        journal: Of what was measured.
        tell: Takes a line for everything that was measured.
    """

    options: Namespace
    journal: Journal
    tell: Tell

    @property
    def runs(self) -> Path:
        """Return the folder of trainings."""
        return Path(self.options.runs)

    def entry(self, key: str, make: Callable[[], Entry], line: Callable[[Entry], str]) -> Entry:
        """Return the entry of a key; what is not in the journal is made, and told by its line."""

        def make_now() -> Entry:
            entry = make()
            self.tell(line(entry))
            return entry

        return self.journal.entry(key, make_now)

    def trained(self, rows: Sequence[Row]) -> dict[str, Any]:
        """Return training -> how it ended, of those that ended."""
        names = [run.training for row in rows if row.recipe for run in row.runs]
        endings = {name: finished(self.runs / name) for name in names}
        return {name: ended for name, ended in endings.items() if ended is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the thesis.

    Attributes:
        description: For its help.
        measure: Measures its rows, as plain values.
        to_text: A record as tables in Markdown.
        add_options: Adds options of its own to `measure`.
        rows: Its rows, once the options of `train` are known; None for a table that trains as it
            measures.
        trainee: A network to train, or why it cannot be.
        add_train_options: Adds options of its own to `train`.
        steps: At which a schedule would end; None for the recipe's.
        digits: Of numbers in its record.
    """

    description: str
    measure: Callable[[Request], Record]
    to_text: Callable[[Record], str]
    add_options: Callable[[ArgumentParser], None]
    rows: Callable[[Namespace], Sequence[Row]] | None = None
    trainee: Callable[[Run, Namespace], Trainee | str] | None = None
    add_train_options: Callable[[ArgumentParser], None] = lambda _: None
    steps: int | None = None
    digits: int = 6


def run(tables: Mapping[str, Table], words: Sequence[str]) -> None:
    """Train or measure a table.

    Raises:
        SystemExit: If something is missing; says what.
    """
    arguments = _parser(tables).parse_args(words)
    torch.set_num_threads(1)
    try:
        arguments.run(tables[arguments.table], arguments)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def _parser(tables: Mapping[str, Table]) -> ArgumentParser:
    form: Any = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = ArgumentParser(description=__doc__, **form)
    parsers = parser.add_subparsers(dest="table", required=True)
    for name, table in tables.items():
        table_parser = parsers.add_parser(name, description=table.description, **form)
        commands = table_parser.add_subparsers(required=True)
        if table.trainee is not None:
            train = commands.add_parser("train", description=table.description, **form)
            train.set_defaults(run=_train)
            train.add_argument("--out-dir", type=Path, required=True, help="folder of all runs")
            train.add_argument("--data", type=Path, help="pictures; without them drawn scenes")
            train.add_argument("--cpu-minutes", type=float, default=15.0, help="with samples, each")
            train.add_argument("--vgg", type=Path, help="weights of VGG-19 (torchvision's vgg19)")
            train.add_argument("--workers", type=int, default=1, help="processes of samples")
            train.add_argument("--rows", nargs="*", metavar="ROW", help="some of them, or ROW-SEED")
            table.add_train_options(train)
        measure = commands.add_parser("measure", description=table.description, **form)
        measure.set_defaults(run=_measure)
        measure.add_argument("--runs", type=Path, required=True, help="the --out-dir of train")
        measure.add_argument("-o", "--output", type=Path, required=True, help="record (JSON)")
        measure.add_argument("--overwrite", action="store_true", help="write over a record")
        table.add_options(measure)
    return parser


def _train(table: Table, options: Namespace) -> None:
    assert table.rows is not None
    assert table.trainee is not None
    time = EqualTime(
        out_dir=options.out_dir,
        pictures=options.data,
        cpu_minutes=options.cpu_minutes,
        steps=table.steps,
        workers=options.workers,
    )
    for one in chosen_trainings(table.rows(options), options.rows):
        trainee = table.trainee(one, options)
        if isinstance(trainee, str):
            _tell(f"{one.training}: left out: {trainee}")
        else:
            trained(trainee, time, _tell)


def _measure(table: Table, options: Namespace) -> None:
    out: Path = options.output
    if out.exists() and not options.overwrite:
        raise ContractError(f"{out} is there already: give --overwrite")
    if not out.parent.is_dir():
        raise ContractError(f"there is no folder {out.parent} for the record")
    options.runs.mkdir(parents=True, exist_ok=True)
    request = Request(options=options, journal=Journal(options.runs / JOURNAL), tell=_tell)
    record = table.measure(request)
    with atomic_output(out) as part:
        part.write_text(to_compact_json(record, table.digits) + "\n", encoding="utf-8")
    print(table.to_text(record))


def _tell(line: str) -> None:
    print(line, flush=True)

"""The front of methods: decibels against CPU-seconds, modern methods beside camkit's.

    python -m tools.methods train --data PICTURES --minutes 20 --work-dir out/methods
    python -m tools.methods judge --data OTHERS --minutes 20 --work-dir out/methods
    python -m tools.methods chart

`train` makes the samples of the recipe once and trains every method from scratch for the same
CPU-minutes, one after the other; stopped, it goes on where it was. `judge` restores the same
pictures, through fresh copies of the lens, with every method that is trained by then, the
classical ones and the networks that the bundle holds; it goes on likewise, and writes record and
page. `chart` draws the record.
"""

import argparse
import json
import sys
from argparse import ArgumentParser, Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, cast

import cv2
import torch

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.errors import CamkitError, ContractError
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.kind import read_recipe, training_kind
from tools.comparison.tuning import tuned_from_json
from tools.methods.developers import time_developers
from tools.methods.equal_minutes import Budget, train_method
from tools.methods.front_chart import RECORD, write_front_chart
from tools.methods.front_page import to_page
from tools.methods.judging import (
    Protocol,
    front_rows,
    judged,
    separate_row,
    timed,
    to_record,
)
from tools.methods.method_list import METHODS
from tools.methods.sample_store import open_store
from tools.methods.separate_peer import SeparatePeer
from tools.tables.records import to_compact_json

RUNS: Final = Path("out/methods")
TOLD_SAMPLES: Final = 100
DIGITS: Final = 5


def main() -> None:
    """Run a command."""
    arguments = parse_arguments(sys.argv[1:])
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    try:
        arguments.run(arguments)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error


def parse_arguments(words: list[str]) -> Namespace:
    """Read the command line."""
    form: Any = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = ArgumentParser(description=__doc__, **form)
    commands = parser.add_subparsers(required=True)
    training, judging, drawing = (commands.add_parser(n) for n in ("train", "judge", "chart"))
    training.set_defaults(run=train)
    training.add_argument("--recipe", type=Path, default=Path("models_def/recipes/duet.toml"))
    training.add_argument("--samples", type=int, default=1500, help="made once, 2.1 MB each")
    training.add_argument("--methods", default=",".join(METHODS), help="some of them")
    judging.set_defaults(run=judge)
    judging.add_argument("--bundle", default="duet")
    judging.add_argument("--tuned", type=Path, default=Path("docs/results/quality.json"))
    judging.add_argument("--pictures", type=int, help="only the first ones, by name")
    judging.add_argument("--side-px", type=int, default=512, help="middle of a picture")
    judging.add_argument("--deepinv-python", type=Path, help="of an environment that has deepinv")
    judging.add_argument("--rounds", type=int, default=5, help="of timing")
    for command in (training, judging):
        command.add_argument("--data", type=Path, required=True, help="folder of pictures")
        command.add_argument("--minutes", type=float, default=20.0, help="of the CPU, each method")
        command.add_argument("--work-dir", type=Path, default=RUNS)
    drawing.set_defaults(run=chart)
    for command in (judging, drawing):
        command.add_argument("--record", type=Path, default=RECORD, help="JSON, the page beside it")
    drawing.add_argument("-o", "--output", type=Path, default=Path("docs/images/front.png"))
    return parser.parse_args(words)


def train(arguments: Namespace) -> None:
    """Make the samples, and train the methods."""
    names = arguments.methods.split(",")
    if unknown := set(names) - METHODS.keys():
        raise ContractError(f"methods are {', '.join(METHODS)}; got {', '.join(sorted(unknown))}")
    recipe = cast("BayerRecipe", read_recipe(arguments.recipe))
    arguments.work_dir.mkdir(parents=True, exist_ok=True)
    kind = training_kind(recipe.kind)
    store = open_store(
        arguments.work_dir / "samples",
        recipe,
        kind.prepare(recipe, arguments.recipe.parent, arguments.work_dir),
        arguments.data,
        arguments.samples,
        lambda number: None if number % TOLD_SAMPLES else tell(f"{number} samples"),
    )
    for name in names:
        tell(f"{name}: training for {arguments.minutes:g} CPU-minutes")
        train_method(name, store, budget_of(arguments), tell)


def judge(arguments: Namespace) -> None:
    """Judge and time what is trained; write record and page."""
    bundle = open_bundle(find_bundle(arguments.bundle))
    tuned = json.loads(arguments.tuned.read_text(encoding="utf-8"))["tuned"]["values"]
    budget = budget_of(arguments)
    arguments.work_dir.mkdir(parents=True, exist_ok=True)
    rows = front_rows(bundle, budget, tuned_from_json(tuned))
    protocol = Protocol(
        bundle=bundle,
        pictures=arguments.data,
        count=arguments.pictures,
        most_px=arguments.side_px,
        work_dir=arguments.work_dir,
    )
    with ExitStack() as stack:
        if arguments.deepinv_python is not None:
            peer = stack.enter_context(SeparatePeer(arguments.deepinv_python))
            rows.append(separate_row(peer))
        measurements = judged(rows, protocol, tell)
        seconds = timed(rows, protocol, arguments.rounds, tell)
    developers = time_developers(arguments.bundle, arguments.rounds, tell)
    record = to_record(rows, measurements, seconds, developers, budget)
    text = to_compact_json(record, DIGITS)
    arguments.record.write_text(text.replace('{"name"', '\n{"name"') + "\n", encoding="utf-8")
    arguments.record.with_suffix(".md").write_text(to_page(record), encoding="utf-8")
    tell(to_page(record))


def chart(arguments: Namespace) -> None:
    """Draw the record."""
    write_front_chart(arguments.output, arguments.record)
    tell(str(arguments.output))


def budget_of(arguments: Namespace) -> Budget:
    """Return the time of every method, and where its weights lie."""
    return Budget(minutes=arguments.minutes, folder=arguments.work_dir / "runs")


def tell(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)


if __name__ == "__main__":
    main()

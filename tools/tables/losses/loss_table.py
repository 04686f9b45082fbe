"""Table 3.1: what a loss is worth where it was trained, and elsewhere.

    python -m tools.tables losses train RECIPE.toml --rows supervised adversarial perceptual \
        --data PICTURES --cpu-minutes 60 --out-dir out/loss-table
    python -m tools.tables losses measure --runs out/loss-table --data OTHERS -o RECORD.json

Trained is before a display, judged there and outside: `train` writes both recipes into OUT_DIR,
RECIPE_display.toml and RECIPE_wild.toml (`--depths-mm` gives distances of scenes outside), and two
more that are judged by, RECIPE_display_judged.toml and RECIPE_wild_judged.toml, which draw no
scenes; `--rows` without a name does no more than that. `--camera CAMERA.toml` puts another camera
before the sizes and losses of RECIPE. Rows are sizes of its network. Those that need no training
are `capture`, the input, `wiener`, the bank alone, and of cameras behind a mosaic `wiener-alone`
(each colour for itself), `rl`, `admm-tv` and `cross-channel`. PSNR and SSIM are those of sRGB;
`perceptual` is the 1-norm of Gram matrices (eq. 3.7), by random features unless `--vgg FILE` gives
those of VGG-19.
All rows are judged by the last average of their weights. Below the table stands a verdict on
"supervised overfits", from paired samples.

A lens with a haze has its frames made between: with `--data PICTURES` in OUT_DIR/RECIPE_display to
train on, with `--data OTHERS` in OUT_DIR/RECIPE_display_judged and OUT_DIR/RECIPE_wild_judged
(`camkit prepare --out-dir`). `--frames 6,8` has 6 frames to train on and 8 to judge on, the latter
through other copies of the lens.

References: Sun 2021, table 3.1.
"""

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.training.adversarial.content import Relu32
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.kind import Restorer, read_recipe, training_kind
from tools.tables.equal_training import Trainee, checkpoint_of, finished
from tools.tables.journal import Entry, digest, file_digest
from tools.tables.losses.classical import METHODS
from tools.tables.losses.domain import METRICS, Domain, as_filtered, domain
from tools.tables.losses.overfitting import overfitting, sentences
from tools.tables.losses.twins import Counts, judged_by, write_twins
from tools.tables.records import markdown_table
from tools.tables.runner import Record, Request, Table
from tools.tables.table_rows import Row, Run, chosen_rows

DOMAINS: Final = ("lab", "wild")
DIGITS: Final = 5
JUDGED: Final = 3
"""Counts how rows are judged; what was judged before is judged again."""
FRAMES: Final = "tiles.json"


def rows(options: Namespace) -> tuple[Row, ...]:
    """Write both recipes into the folder of the runs; return a row for every size."""
    options.out_dir.mkdir(parents=True, exist_ok=True)
    write_twins(
        options.recipe,
        options.out_dir,
        options.depths_mm,
        camera=options.camera,
        counts=options.frames,
    )
    return _rows_of(options.out_dir)


def _rows_of(runs: Path) -> tuple[Row, ...]:
    lab, _ = _twins(runs)
    (networks,) = read_recipe(lab).networks.values()
    return tuple(
        Row(key=size, label=size, method="network", recipe=lab.name, size=size, seeds=(1,))
        for size in networks
    )


def _twins(runs: Path) -> tuple[Path, Path]:
    """Return the recipes of a folder: before a display, outside.

    Raises:
        ContractError: If there are none, or of several cameras.
    """
    recipes = sorted(runs.glob("*_display.toml"))
    if len(recipes) != 1:
        raise ContractError(f"{runs} must hold one recipe *_display.toml; it has {len(recipes)}")
    return recipes[0], recipes[0].with_name(recipes[0].name.replace("_display.toml", "_wild.toml"))


def trainee(run: Run, options: Namespace) -> Trainee:
    """Return the network of a row, trained before the display."""
    lab, _ = _twins(options.out_dir)
    recipe = read_recipe(lab)
    schedule = recipe.network(run.row.size).schedule
    frames = options.out_dir / lab.stem
    frames.mkdir(exist_ok=True)
    return Trainee(
        run=run,
        recipe=lab.read_text(encoding="utf-8"),
        material=lambda: training_kind(recipe.kind).prepare(recipe, lab.parent, frames),
        vgg=options.vgg if schedule.content.looks else None,
        sharp=options.sharp if schedule.loss == "adversarial" else None,
    )


def measure(request: Request) -> Record:
    """Measure every row in both domains.

    Raises:
        ContractError: If there are no recipes, or no such row.
    """
    lab, wild = _twins(request.runs)
    trained = [
        row
        for row in chosen_rows(_rows_of(request.runs), request.options.rows)
        if finished(request.runs / row.runs[0].training) is not None
    ]
    entries: dict[str, Entry] = {}
    for name in UNTRAINED:
        entries[name] = request.entry(
            _digest(name, request), partial(_judge_untrained, name, request), partial(line, name)
        )
    for row in trained:
        weights = file_digest(checkpoint_of(request.runs, row.runs[0]))
        entries[row.key] = request.entry(
            _digest(row.key, request, weights),
            partial(_judge_trained, row.runs[0], request),
            partial(line, row.key),
        )
    minutes = [ended["cpu_minutes"] for ended in request.trained(trained).values()]
    vgg: Path | None = request.options.vgg
    return {
        "lab": lab.stem,
        "wild": wild.stem,
        "minutes": max(minutes, default=0.0),
        "samples": request.options.samples,
        "features": "random" if vgg is None else vgg.name,
        "classical": {"best": max(CLASSICAL, key=lambda name: entries[name]["lab"]["psnr_db"])},
        "overfitting": overfitting(entries),
        "rows": entries,
    }


def _digest(row: str, request: Request, *more: object) -> str:
    """Return a hash of all that decides a row: the recipes, their frames, what is judged on."""
    options = request.options
    recipes = [path for twin in _twins(request.runs) for path in (twin, judged_by(twin))]
    frames = [
        path
        for recipe in recipes
        for path in sorted((request.runs / recipe.stem).glob(f"*/{FRAMES}"))
    ]
    texts = [path.read_text(encoding="utf-8") for path in (*recipes, *frames)]
    return digest(JUDGED, row, *texts, options.data, options.samples, options.vgg, *more)


def _judge_untrained(name: str, request: Request) -> Entry:
    method = name if name in METHODS else None
    return _scores(UNTRAINED[name], _domains(request, method), request)


def _judge_trained(run: Run, request: Request) -> Entry:
    # the last average of all: some losses are not chosen by decibels
    checkpoint = replace(read_checkpoint(checkpoint_of(request.runs, run)), best={})
    network = load_network(checkpoint)

    def restore(planes: Tensor) -> Tensor:
        with torch.no_grad():
            return torch.as_tensor(network(planes))

    lab, _ = _twins(request.runs)
    entry = read_recipe(lab).network(run.row.size)
    form = [entry.network, sorted(map(str, entry.config.items()))]
    ending = finished(request.runs / run.training)
    training = {"loss": entry.schedule.loss, "network": form, "trained": ending}
    return training | _scores(restore, _domains(request), request)


def _scores(restore: Restorer, domains: Mapping[str, Domain], request: Request) -> Entry:
    features = Relu32(request.options.vgg)
    return {where: one.score(restore, features) for where, one in domains.items()}


def _domains(request: Request, method: str | None = None) -> dict[str, Domain]:
    """Return what rows are judged on: unseen pictures, and no drawn scenes."""
    options, domains = request.options, {}
    for where, twin in zip(DOMAINS, _twins(request.runs), strict=True):
        recipe = judged_by(twin)
        folder = request.runs / recipe.stem
        domains[where] = domain(recipe, folder, options.data, options.samples, method)
    return domains


def _capture(planes: Tensor) -> Tensor:
    return planes[:, :3]


UNTRAINED: Final[dict[str, Restorer]] = {
    "capture": _capture,
    "wiener": as_filtered,
    **dict.fromkeys(METHODS, as_filtered),
}
"""Of a row without training: what it makes of a sample's planes."""
CLASSICAL: Final[tuple[str, ...]] = ("wiener", *METHODS)


def line(name: str, entry: Entry) -> str:
    """Return a row for people while it runs."""
    words = (f"{where} {entry[where]['psnr_db']:.2f} dB" for where in DOMAINS)
    return f"{name:24} {', '.join(words)}"


def tables_text(record: Record) -> str:
    """Return the table, that of distances and the verdict in Markdown."""
    verdicts = "\n".join(f"- {sentence}" for sentence in sentences(record["overfitting"]))
    parts = (table(record["rows"]), table_of_distances(record["rows"]), verdicts)
    return "\n\n".join(part for part in parts if part) + "\n"


def table(entries: Mapping[str, Entry]) -> str:
    """Return the table as Markdown; the last column is what a row loses abroad."""
    columns = [(where, metric) for where in DOMAINS for metric in METRICS]
    heads = ["row", *(" ".join(column) for column in columns), "steps", "lab - wild, dB"]
    cells = []
    for name, entry in entries.items():
        loss_db = entry["lab"]["psnr_db"] - entry["wild"]["psnr_db"]
        values = [f"{entry[where][metric]:.3f}" for where, metric in columns]
        cells.append(
            [name, *values, str(entry.get("trained", {}).get("steps", "")), f"{loss_db:.2f}"]
        )
    return markdown_table(heads, cells)


def table_of_distances(entries: Mapping[str, Entry]) -> str:
    """Return PSNR abroad by distance of the scenes; empty where all are at one."""
    names = next(iter(entries.values()))["wild"].get("at", {})
    if not names:
        return ""
    cells = []
    for name, entry in entries.items():
        at = entry["wild"].get("at", {})
        cells.append([name, *(f"{at[place]:.3f}" if place in at else "" for place in names)])
    return markdown_table(["wild psnr_db", *names], cells)


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(word) for word in text.split(","))


def _counts(text: str) -> Counts:
    frames, judged, *copies = (int(word) for word in text.split(","))
    if len(copies) > 1 or min(frames, judged, *copies) < 1:
        raise ValueError(text)
    return Counts(frames=frames, judged=judged, copies=copies[0] if copies else 1)


def _two_or_more(text: str) -> int:
    number = int(text)
    if number < 2:  # fewer tell no error of their mean
        raise ValueError(text)
    return number


def _train_options(train: ArgumentParser) -> None:
    more: Any = train.add_argument
    more("recipe", type=Path)
    more("--camera", type=Path, help="its recipe; sizes and losses are those of RECIPE")
    more("--depths-mm", type=_numbers, default=(), help="of scenes outside, such as 2000,inf")
    more("--frames", type=_counts, metavar="TRAIN,JUDGED[,COPIES]", help="of a lens with a haze")
    more("--sharp", type=Path, help="pictures without captures, for the critic")


def _options(measure: ArgumentParser) -> None:
    more: Any = measure.add_argument
    more("--data", type=Path, help="pictures to judge on")
    more("--vgg", type=Path, help="weights of VGG-19")
    more("--samples", type=_two_or_more, default=48, help="to judge on, of each recipe")
    more("--rows", nargs="+", metavar="SIZE", help="those of the recipe that are trained")


TABLE: Final = Table(
    description=__doc__,
    rows=rows,
    trainee=trainee,
    add_train_options=_train_options,
    measure=measure,
    to_text=tables_text,
    add_options=_options,
    digits=DIGITS,
)

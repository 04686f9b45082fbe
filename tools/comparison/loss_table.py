"""What a loss is worth where it was trained, and elsewhere: table 3.1 re-done.

    python -m tools.comparison.loss_table RECIPE.toml \
        --rows supervised adversarial perceptual --data PICTURES --fresh OTHERS --minutes 60

Trained is before a display, judged there and outside: `tools.comparison.twins` writes both recipes
into OUT_DIR, RECIPE_display.toml and RECIPE_wild.toml (`--depths-mm` gives distances of scenes
outside). With `--wild WILD.toml` the first recipe is LAB itself, whose samples are trained on, and
WILD one of the same camera in other circumstances. Rows are sizes of LAB's network;
`SIZE=LAB.toml,WILD.toml` is one of other recipes, of another lens say. Every row is trained for so
many CPU minutes and judged on samples of both recipes, cut from OTHERS: LAB_judged.toml and
WILD_judged.toml, which are written too, draw no scenes (with `--wild` that is up to them; where
they are not, LAB and WILD serve). Rows that need no training are `capture`, the input, `wiener`,
the bank alone, and of cameras behind a mosaic `wiener-alone` (each colour for itself), `rl`,
`admm-tv` and `cross-channel` (`tools.comparison.classical`), their numbers tuned by PSNR on
`--tune` samples of those that networks learn from. PSNR and SSIM are those of sRGB;
`perceptual` is the 1-norm of Gram matrices (eq. 3.7), by random features unless `--vgg FILE` gives
those of VGG-19.

What is finished is in the journal of the folder and not done again; a row that was interrupted goes
on unless something that it was trained by has changed, and the table is written after every row.
Beside it stands a verdict on "supervised overfits", from paired samples
(`tools.comparison.overfitting` has the rule). All rows are judged by the last average of their
weights, none by one that validated best before the display.

A lens with a haze has its frames made before (`--only-recipes` writes the recipes and ends): with
`--data PICTURES` in OUT_DIR/LAB to train on, with `--data OTHERS` in OUT_DIR/LAB_judged and
OUT_DIR/WILD_judged (`camkit prepare --out-dir`, the names of the recipes without .toml). `--frames
6,8` has 6 frames to train on and 8 to judge on, the latter through other copies of the lens.
`--camera CAMERA.toml` puts another camera before the sizes and losses of RECIPE.
"""

import argparse
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor

from camkit.errors import CamkitError
from camkit.models_def.training.adversarial.content import Relu32
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.kind import Restorer, read_recipe
from camkit.models_def.training.trainer import TrainOptions, train
from camkit.runtime.bank.baselines import method_numbers
from tools.comparison.classical import METHODS, TUNABLE, Numbers, tuned
from tools.comparison.compact_json import to_compact_json
from tools.comparison.domain import METRICS, Circumstances, as_filtered, circumstances
from tools.comparison.overfitting import overfitting, sentences
from tools.comparison.twins import Counts, judged_by, write_twins
from tools.lens_table import kept

DOMAINS: Final = ("lab", "wild")
JUDGE_SEED: Final = 909
TUNE_SEED: Final = 808
DIGITS: Final = 5
JUDGED: Final = 3
"""Counts how rows are judged; what was judged before is judged again."""
FRAMES: Final = "tiles.json"
CONDITIONS: Final = "conditions.txt"
"""Behind the name of a checkpoint: the hash of what it was trained by."""

Entry = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is the same for all rows.

    Attributes:
        data: Pictures to train on.
        fresh: Pictures to judge on.
        sharp: Pictures for the critic.
        vgg: Weights of VGG-19.
        minutes: CPU time of a row.
        samples: To judge on, of each domain.
        tune: Samples that numbers of classical methods are tuned on; 0 for the runtime's.
        out_dir: Where everything goes.
    """

    data: Path | None
    fresh: Path | None
    sharp: Path | None
    vgg: Path | None
    minutes: float
    samples: int
    tune: int
    out_dir: Path

    def digest(self, row: "Row") -> str:
        """Return a hash of all that decides a row."""
        recipes = [path for recipe in (row.lab, row.wild) for path in (recipe, judged_by(recipe))]
        texts = [text for recipe in recipes for text in self._told(recipe)]
        tuning = (self.tune,) if row.size in TUNABLE else ()
        return _hash(
            JUDGED, row.size, *texts, self.fresh, self.samples, *self._trained_by(), *tuning
        )

    def training_digest(self, row: "Row") -> str:
        """Return a hash of all that decides the weights of a row."""
        return _hash(row.size, *self._told(row.lab), *self._trained_by())

    def _told(self, recipe: Path) -> list[str]:
        """Return texts of a recipe and of what says how its frames were made, where they are."""
        frames = sorted((self.out_dir / recipe.stem).glob(f"*/{FRAMES}"))
        return [path.read_text(encoding="utf-8") for path in (recipe, *frames) if path.exists()]

    def _trained_by(self) -> tuple[object, ...]:
        return self.data, self.sharp, self.vgg, self.minutes


def _hash(*given: object) -> str:
    return hashlib.sha256("\n".join(map(str, given)).encode()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the table.

    Attributes:
        size: Of a network, or one of `UNTRAINED`.
        lab: Recipe that it is trained by.
        wild: Recipe of the same camera in other circumstances.
    """

    size: str
    lab: Path
    wild: Path


def main() -> int:
    """Train and judge every row, and write the table."""
    arguments = parse()
    conditions = Conditions(
        data=arguments.data,
        fresh=arguments.fresh,
        sharp=arguments.sharp,
        vgg=arguments.vgg,
        minutes=arguments.minutes,
        samples=arguments.samples,
        tune=arguments.tune,
        out_dir=arguments.out_dir,
    )
    conditions.out_dir.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    lab, wild = arguments.lab, arguments.wild
    try:
        if wild is None:
            lab, wild = write_twins(
                lab,
                conditions.out_dir,
                arguments.depths_mm,
                camera=arguments.camera,
                counts=arguments.frames and Counts(**arguments.frames),
            )
        if not arguments.only_recipes:
            fill(arguments.rows, lab, wild, conditions)
    except CamkitError as error:
        raise SystemExit(f"error: {error}") from error
    return 0


def fill(names: Sequence[str], lab: Path, wild: Path, conditions: Conditions) -> None:
    """Make row after row, and write the table after each."""
    rows: dict[str, Entry] = {}
    for name in (*UNTRAINED, *names):
        row = row_of(name, lab, wild)
        rows[name] = kept(
            conditions.out_dir, conditions.digest(row), lambda row=row: measure(row, conditions)
        )
        print(line(name, rows[name]), flush=True)
        if set(UNTRAINED) <= set(rows):
            write(rows, lab, wild, conditions)
    print("\n".join(sentences(overfitting(rows))))


def write(rows: dict[str, Entry], lab: Path, wild: Path, conditions: Conditions) -> None:
    """Write table, verdict and all numbers."""
    best = max(CLASSICAL, key=lambda name: float(rows[name]["lab"]["psnr_db"]))
    verdict = overfitting(rows)
    report = {
        "lab": lab.stem,
        "wild": wild.stem,
        "minutes": conditions.minutes,
        "samples": conditions.samples,
        "features": "random" if conditions.vgg is None else conditions.vgg.name,
        "classical": {"best": best},
        "overfitting": verdict,
        "rows": rows,
    }
    written = conditions.out_dir / "loss_table.json"
    written.write_text(to_compact_json(report, DIGITS) + "\n", encoding="utf-8")
    said = "\n".join(f"- {sentence}" for sentence in sentences(verdict))
    tables = "\n".join(filter(None, (table(rows), table_of_distances(rows))))
    written.with_suffix(".md").write_text(f"{tables}\n{said}\n", encoding="utf-8")


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("lab", type=Path, metavar="RECIPE")
    parser.add_argument("--wild", type=Path, help="RECIPE is LAB, and this the other")
    parser.add_argument(
        "--depths-mm", type=distances, default=(), help="of scenes outside, such as 2000,5000,inf"
    )
    parser.add_argument("--camera", type=Path, help="its recipe; sizes and losses are RECIPE's")
    parser.add_argument(
        "--frames",
        type=frame_counts,
        metavar="TRAIN,JUDGED[,COPIES]",
        help="of a lens with a haze, and fabricated copies of it; default: the recipe's",
    )
    parser.add_argument("--only-recipes", action="store_true", help="write the twins and end")
    parser.add_argument("--rows", nargs="+", required=True, help="SIZE or SIZE=LAB.toml,WILD.toml")
    parser.add_argument("--data", type=Path, help="pictures to train on")
    parser.add_argument("--fresh", type=Path, help="pictures to judge on")
    parser.add_argument("--sharp", type=Path, help="pictures without captures, for the critic")
    parser.add_argument("--vgg", type=Path, help="weights of VGG-19")
    parser.add_argument("--minutes", type=float, default=60.0, help="CPU time of a row")
    parser.add_argument("--samples", type=count, default=48, help="to judge on, of each recipe")
    parser.add_argument(
        "--tune",
        type=none_or_more,
        default=12,
        metavar="SAMPLES",
        help="to tune classical methods on, of those to train on; 0: numbers of the runtime",
    )
    parser.add_argument("--out-dir", type=Path, default=Path("out/loss-table"))
    return parser.parse_args()


def count(text: str) -> int:
    """Read a number of samples: two at least, to tell an error of their mean."""
    number = int(text)
    if number < 2:
        raise ValueError(text)
    return number


def none_or_more(text: str) -> int:
    """Read a number that may be 0."""
    number = int(text)
    if number < 0:
        raise ValueError(text)
    return number


def distances(text: str) -> tuple[float, ...]:
    """Read distances."""
    return tuple(float(word) for word in text.split(","))


def frame_counts(text: str) -> dict[str, int]:
    """Read counts of frames."""
    numbers = [int(word) for word in text.split(",")]
    if not 2 <= len(numbers) <= 3 or min(numbers) < 1:
        raise ValueError(text)
    return dict(zip(("frames", "judged", "copies"), numbers, strict=False))


def row_of(name: str, lab: Path, wild: Path) -> Row:
    """Return the row of a word of the command line."""
    size, _, recipes = name.partition("=")
    own = recipes.split(",") if recipes else [str(lab), str(wild)]
    if len(own) != 2:
        raise SystemExit(f"{name}: a row is SIZE or SIZE=LAB.toml,WILD.toml")
    return Row(size=size, lab=Path(own[0]), wild=Path(own[1]))


def measure(row: Row, conditions: Conditions) -> Entry:
    """Train a row, where it needs that, and judge it in both domains."""
    method = row.size if row.size in METHODS else None
    numbers, found = None, {}
    if method in TUNABLE:
        tried = tune(method, row.lab, conditions) if conditions.tune else []
        numbers = tried[0][0] if tried else None
        found = {"numbers": numbers or dict(method_numbers(method)), "tuned": tried}
    home, abroad = (
        to_judge(path, conditions).domain(conditions.samples, method, numbers)
        for path in (row.lab, row.wild)
    )
    if home.designed != abroad.designed:
        raise SystemExit(f"{row.lab} and {row.wild} are of two lenses; a row needs two of one")
    if row.size in UNTRAINED:
        restore = UNTRAINED[row.size]
    else:
        restore, found = restorer(row, conditions)
    features = Relu32(conditions.vgg)
    pairs = zip(DOMAINS, (home, abroad), strict=True)
    return found | {name: one.score(restore, features) for name, one in pairs}


def tune(method: str, recipe_path: Path, conditions: Conditions) -> list[tuple[Numbers, float]]:
    """Tune a method by PSNR on samples that networks learn from; see `tuned`.

    Args:
        method: One of `TUNABLE`.
        recipe_path: What would be trained by.
        conditions: Pictures and number.
    """
    folder = conditions.out_dir / recipe_path.stem
    taught = circumstances(recipe_path, folder, conditions.data, TUNE_SEED)

    def score(numbers: Numbers) -> float:
        return taught.domain(conditions.tune, method, numbers).psnr_db(as_filtered)

    return tuned(TUNABLE[method].start, score)


def to_judge(recipe_path: Path, conditions: Conditions) -> Circumstances:
    """Open what rows of a recipe are judged on: unseen pictures, and no drawn scenes if it can."""
    few = judged_by(recipe_path)
    folder = conditions.out_dir / f"{recipe_path.stem}_judged"
    chosen = few if few.exists() else recipe_path
    return circumstances(chosen, folder, conditions.fresh, JUDGE_SEED)


def restorer(row: Row, conditions: Conditions) -> tuple[Restorer, Entry]:
    """Train a network, or go on with it; give it, and what was spent."""
    entry = read_recipe(row.lab).network(row.size)
    schedule = entry.schedule
    folder = conditions.out_dir / row.lab.stem
    folder.mkdir(parents=True, exist_ok=True)
    begun, digest = folder / f"{row.size}.{CONDITIONS}", conditions.training_digest(row)
    if not (begun.exists() and begun.read_text(encoding="utf-8") == digest):
        # gone before the hash is there, or a run killed early would go on with them
        for stale in folder.glob(f"*_{row.size}.pt"):
            stale.unlink()
        begun.write_text(digest, encoding="utf-8")
    options = TrainOptions(
        out_dir=folder,
        size=row.size,
        data_folder=conditions.data,
        max_cpu_minutes=conditions.minutes,
        resume=any(folder.glob(f"*_{row.size}.pt")),
        sharp_folder=conditions.sharp if schedule.loss == "adversarial" else None,
        vgg=conditions.vgg if schedule.content.looks else None,
    )
    result = train(row.lab, options)
    # the last average of all: some losses are not chosen by decibels
    network = load_network(replace(read_checkpoint(result.checkpoint), best={}))

    def restore(planes: Tensor) -> Tensor:
        with torch.no_grad():
            return torch.as_tensor(network(planes))

    spent = {"steps": result.steps, "cpu_s": result.cpu_s, "valid_db": result.valid_db}
    form = [str(row.lab), entry.network, sorted(map(str, entry.config.items()))]
    return restore, {"loss": schedule.loss, "network": form, "trained": spent}


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
    told = (f"{where} {entry[where]['psnr_db']:.2f} dB" for where in DOMAINS)
    return f"{name:24} {', '.join(told)}"


def table(rows: dict[str, Entry]) -> str:
    """Return the table as Markdown; the last column is what a row loses abroad."""
    heads = [f"{where} {metric}" for where in DOMAINS for metric in METRICS]
    lines = [f"| row | {' | '.join(heads)} | steps | lab - wild, dB |"]
    lines.append("|---" * (len(heads) + 3) + "|")
    for name, entry in rows.items():
        cells = [f"{entry[where][metric]:.3f}" for where in DOMAINS for metric in METRICS]
        lost = entry["lab"]["psnr_db"] - entry["wild"]["psnr_db"]
        steps = entry.get("trained", {}).get("steps", "")
        lines.append(f"| {name} | {' | '.join(cells)} | {steps} | {lost:.2f} |")
    return "\n".join(lines) + "\n"


def table_of_distances(rows: dict[str, Entry]) -> str:
    """Return PSNR abroad by distance of the scenes; empty where all are at one."""
    names = next(iter(rows.values()))["wild"].get("at", {})
    if not names:
        return ""
    lines = [f"| wild psnr_db | {' | '.join(names)} |", "|---" * (1 + len(names)) + "|"]
    for name, entry in rows.items():
        at = entry["wild"].get("at", {})
        cells = [f"{at[far]:.3f}" if far in at else "" for far in names]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    raise SystemExit(main())

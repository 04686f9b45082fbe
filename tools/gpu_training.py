"""Training where a GPU is lent for minutes: packed here, gone on with there, packed again.

python -m tools.gpu_training pack training.tgz --data PICTURES --valid VALIDATION
    (there)  tar xzf training.tgz && python -m tools.gpu_training go job OUT --minutes 9
python -m tools.gpu_training pack training.tgz --data PICTURES --valid VALIDATION --checkpoints OUT

The archive holds the code, the recipe, kernels, pictures and a checkpoint of every size: today's
weights of the bundle, random ones for a size that it lacks (the teacher). There, samples are made
on all cores, and torch, numpy, scipy, OpenCV, Pillow, pydantic and safetensors are needed, no onnx
and no onnxruntime. Sizes are trained one after the other, each for its share of the minutes; the
learning rate falls over the minutes of all sessions.
"""

import argparse
import os
import shutil
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

from camkit.errors import BundleError, ContractError
from camkit.models_def.training.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from camkit.models_def.training.credits import describe_data
from camkit.models_def.training.first_weights import FirstWeights, read_first_weights
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.kind import Material, read_recipe, training_kind
from camkit.models_def.training.pictures import list_pictures
from camkit.models_def.training.recipe import Recipe
from camkit.models_def.training.trainer import TrainOptions, checkpoint_path, train

CODE = ("camkit", "runtime", "models_def", "tools/__init__.py", "tools/gpu_training.py")
MOST_BYTES = 64 * 2**20
PICTURES_BYTES = 36 * 10**6
"""Of pictures to train on; code, kernels, optimisers and pictures to choose by take as much."""
RECIPE, DATA, VALID = "recipe.toml", "pictures", "valid"
TEACHER = '\n[networks.L]\nnetwork = "lean_l"\nconfig = { bias = true }\n'


def main(words: Sequence[str] | None = None) -> None:
    """Pack a session, or run one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    packed = commands.add_parser("pack")
    packed.add_argument("archive", type=Path)
    packed.add_argument("--recipe", type=Path, default=Path("models_def/recipes/duet.toml"))
    packed.add_argument("--start", type=Path, default=Path("duet"), help="bundle of first weights")
    packed.add_argument("--data", type=Path, required=True)
    packed.add_argument("--valid", type=Path, required=True)
    packed.add_argument("--sizes", default="S,M,L")
    packed.add_argument("--checkpoints", type=Path, help="folder that an earlier session gave")
    packed.add_argument("--cache-dir", type=Path, default=Path("runs/gpu"), help="traced kernels")
    session = commands.add_parser("go")
    session.add_argument("job", type=Path)
    session.add_argument("out", type=Path)
    session.add_argument("--sizes", default="S,M,L")
    session.add_argument("--minutes", type=float, default=9.0, help="of this session")
    session.add_argument("--all-minutes", type=float, default=9.0, help="of a size, all sessions")
    session.add_argument("--device", default="cuda")
    session.add_argument("--workers", type=int, default=max((os.cpu_count() or 2) - 1, 1))
    arguments = parser.parse_args(words)
    (pack if arguments.command == "pack" else go)(arguments)


def pack(arguments: argparse.Namespace) -> None:
    """Write the archive of a session.

    Raises:
        ContractError: If it exceeds what may be carried.
    """
    sizes = arguments.sizes.split(",")
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder)
        text = arguments.recipe.read_text(encoding="utf-8")
        is_taught = "L" in sizes and "[networks.L]" not in text
        (job / RECIPE).write_text(text + TEACHER * is_taught, encoding="utf-8")
        _copy_pictures(arguments.data, job / DATA, PICTURES_BYTES)
        _copy_pictures(arguments.valid, job / VALID, MOST_BYTES)
        recipe = read_recipe(job / RECIPE)
        arguments.cache_dir.mkdir(parents=True, exist_ok=True)
        kind = training_kind(recipe.kind)
        material = kind.prepare(recipe, arguments.recipe.parent, arguments.cache_dir)
        for bank in arguments.cache_dir.glob("bank-*"):
            shutil.copy(bank, job)
        for size in sizes:
            path = checkpoint_path(recipe, TrainOptions(out_dir=job, size=size), None)
            earlier = None if arguments.checkpoints is None else arguments.checkpoints / path.name
            if earlier is not None and earlier.is_file():
                shutil.copy(earlier, path)
                shutil.copy(earlier.with_suffix(".jsonl"), path.with_suffix(".jsonl"))
            else:
                _begin(path, recipe, material, size, arguments.start)
        with tarfile.open(arguments.archive, "w:gz") as archive:
            for name in CODE:
                archive.add(name, filter=_without_bundles)
            archive.add(job, "job")
    if (size_bytes := arguments.archive.stat().st_size) > MOST_BYTES:
        raise ContractError(f"{arguments.archive} has {size_bytes} bytes, over {MOST_BYTES}")


def _without_bundles(entry: tarfile.TarInfo) -> tarfile.TarInfo | None:
    is_idle = entry.name.endswith(".camkit") or "__pycache__" in entry.name
    return None if is_idle else entry


def _copy_pictures(source: Path, folder: Path, most_bytes: int) -> None:
    """Copy as many pictures of a folder as may be carried, evenly over their names."""
    files = list_pictures(source)
    share = min(1.0, most_bytes / sum(file.stat().st_size for file in files))
    folder.mkdir()
    for number, file in enumerate(files):
        if int(share * (number + 1)) > int(share * number):
            shutil.copy(file, folder)
    if (source / "README.md").is_file():  # licences, for the card
        shutil.copy(source / "README.md", folder)


def _begin(path: Path, recipe: Recipe, material: Material, size: str, start: Path) -> None:
    """Write the checkpoint of no step: first weights where the bundle has some of this size."""
    entry, kind = recipe.network(size, recipe.role(None)), training_kind(recipe.kind)
    first = _first_weights(start, size)
    fitter = Fitter(entry, kind.build_network, "cpu", first)
    data = describe_data(recipe.data, path.parent / DATA)
    saved = Checkpoint(
        recipe_toml=(path.parent / RECIPE).read_text(encoding="utf-8"),
        designed=dict(material.designed),
        role=recipe.role(None),
        size=size,
        network=entry.network,
        config=dict(entry.config),
        bank_digest=material.digest(),
        training_data=data + ("" if first is None else first.credit(data)),
        step=0,
        elapsed_s=0.0,
        cpu_s=0.0,
        valid_db=None,
        weights=fitter.weights(),
        average=fitter.average(),
        optimizer=fitter.optimizer_state(),
    )
    write_checkpoint(path, saved)


def _first_weights(start: Path, size: str) -> FirstWeights | None:
    try:
        return read_first_weights(start, size)
    except (BundleError, ContractError) as error:
        print(f"{size} begins at random weights: {error}")
        return None


def go(arguments: argparse.Namespace) -> None:
    """Train every size for its share of the minutes; checkpoints and logs end in `out`."""
    job, out, sizes = arguments.job.resolve(), arguments.out.resolve(), arguments.sizes.split(",")
    recipe = read_recipe(job / RECIPE)
    out.mkdir(parents=True, exist_ok=True)
    for bank in job.glob("bank-*"):  # read where it lies; what comes back should be small
        _link(out / bank.name, bank)
    for size in sizes:
        options = TrainOptions(
            out_dir=out,
            size=size,
            data_folder=job / DATA,
            valid_folder=job / VALID,
            max_minutes=arguments.all_minutes,
            session_minutes=arguments.minutes / len(sizes),
            resume=True,
            workers=arguments.workers,
            device=arguments.device,
            checkpoint_s=30.0,
        )
        path = checkpoint_path(recipe, options, None)
        if not path.exists():
            for file in job.glob(f"{path.stem}.*"):
                shutil.copy(file, out)
        samples = job / f"samples_{size}"
        samples.mkdir(exist_ok=True)
        _link(out / samples.name, samples)
        earlier = read_checkpoint(path)
        result = train(job / RECIPE, options)
        start_db = "" if earlier.best_db is None else f"{earlier.best_db:.3f} to "
        steps = result.steps - earlier.step
        print(f"{size}: {steps} steps more, {start_db}{result.valid_db:.3f} dB", flush=True)
        shutil.rmtree(samples)


def _link(place: Path, target: Path) -> None:
    place.unlink(missing_ok=True)
    place.symlink_to(target)


if __name__ == "__main__":
    main()

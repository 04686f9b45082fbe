"""Tables 4.1 and 4.2: pictures of a 64x32 array, by how it samples and what makes them finer.

    python -m tools.tables spad train --out-dir out/spad-tables --data PICTURES --valid VALIDATION
    python -m tools.tables spad measure --runs out/spad-tables --data TESTS -o RECORD.json

`measure` judges every row that is trained on the sets in a folder (set5, set14, bsd100_half_a), at
four levels of light, beside bicubic interpolation and the linear estimate. What is in the journal
holds as long as nothing changed that decides it: the sampling, the checkpoint, and the pictures.

References: Sun 2021, tables 4.1 and 4.2.
"""

import time
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import Any, Final, cast

import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from camkit.arrays import FloatArray
from camkit.bundle.stages import SuperResolve
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import SETS, bicubic, evaluate_each, read_set
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.recipe import SpadRecipe
from camkit.models_def.kinds.spad.sampling import FULL_LIGHT, Mode, Sampling, make_sampling
from camkit.models_def.kinds.spad.training import PART, sampling_of
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.training.checkpoint import load_network, read_checkpoint, recipe_of
from camkit.models_def.training.kind import Restorer
from camkit.runtime.kinds.spad.finer.covariance import PictureCovariance
from camkit.runtime.kinds.spad.finer.linear import Grid, linear_estimate
from tools.tables.equal_training import checkpoint_of, finished
from tools.tables.journal import Entry, digest, file_digest
from tools.tables.runner import Record, Request, Table
from tools.tables.spad.array_record import (
    LEVELS,
    ROWS_FILE,
    Measured,
    level_name,
    record_of,
    tables_text,
)
from tools.tables.spad.array_training import STEPS, level_sigma, plate_file, trainee
from tools.tables.table_rows import Run, chosen_rows, read_rows

ROWS: Final = read_rows(ROWS_FILE)
LIKE_GAUSSIAN: Final = "gaussian.M-1"
"""Training whose Gaussian rows have that need none."""
COST_PX: Final = 16
"""Side of the array on which work is counted."""

Sets = Mapping[str, Sequence[FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reader:
    """A way of sampling and what makes its photons finer.

    Attributes:
        sampling: The way.
        restore: Light and noise (1, 2, h, w), at so many photons -> picture (1, 1, 4 h, 4 w).
        digest: Of what decides both.
        mac_per_px: Of a network; None for others.
    """

    sampling: Sampling
    restore: Callable[[Exposure], Restorer]
    digest: str
    mac_per_px: float | None = None


def measure(request: Request) -> Record:
    """Measure every row that is trained, by one thread of torch.

    Raises:
        ContractError: If there is no such row, no set, or one holds no picture.
    """
    data: Path = request.options.data
    rows, measured = chosen_rows(ROWS, request.options.rows), Measured()
    sets = {name: read_set(data / name) for name in SETS if (data / name).is_dir()}
    if not sets:
        raise ContractError(f"{data} holds none of {', '.join(SETS)}")
    measured.pictures = {name: len(pictures) for name, pictures in sets.items()}
    measured.sets_left_out = {name: "there is no such folder" for name in SETS if name not in sets}
    for row in rows:
        runs = [r for r in row.runs if not row.recipe or finished(request.runs / r.training)]
        if not runs:
            measured.rows_left_out[row.key] = "not trained yet"
            continue
        measured.seeds[row.key] = tuple(run.seed for run in runs)
        for run in runs:
            reader = _reader(run, request)
            if reader.mac_per_px is not None:
                measured.mac_per_px[row.key] = reader.mac_per_px
            for name, photons, entry in _entries(run, reader, sets, request):
                measured.entries[run.name, name, photons] = entry
    return record_of(rows, measured, request.trained(rows))


def _entries(
    run: Run, reader: Reader, sets: Sets, request: Request
) -> Iterator[tuple[str, float, Entry]]:
    for name, photons in product(sets, LEVELS):
        of_pictures = (picture.tobytes() for picture in sets[name])
        key = digest(run.name, name, photons, reader.digest, *of_pictures)
        make = partial(_judged, run, reader, sets[name], photons)
        yield name, photons, request.entry(key, make, partial(_line, name, photons))


def _line(name: str, photons: float, entry: Entry) -> str:
    mean = fmean(entry["psnr_db"])
    return f"{entry['run']} on {name}, {level_name(photons)}: {mean:.2f} dB"


def _judged(run: Run, reader: Reader, pictures: Sequence[FloatArray], photons: float) -> Entry:
    """Return PSNR and SSIM of every picture, and CPU-seconds for all of them."""
    exposure = Exposure(photons=photons / FULL_LIGHT if run.row.equal_counts else photons)
    began = time.process_time()
    scores = evaluate_each(pictures, reader.sampling, exposure, reader.restore(exposure))
    return {
        "run": run.name,
        "psnr_db": [round(db, 4) for db, _ in scores],
        "ssim": [round(alike, 5) for _, alike in scores],
        "cpu_s": round(time.process_time() - began, 3),
    }


def _reader(run: Run, request: Request) -> Reader:
    row = run.row
    if not row.recipe:
        sampling = _plain_sampling(row.optics, request)
        restore = _bicubic if row.method == "bicubic" else linear_restorer
        return Reader(
            sampling=sampling,
            restore=lambda exposure: restore(sampling, exposure),
            digest=_sampling_digest(sampling, row.method),
        )
    path = checkpoint_of(request.runs, run)
    checkpoint = read_checkpoint(path)
    network = load_network(checkpoint)
    if row.optics == "gaussian_untrained":
        sampling = make_sampling("gaussian")
    else:
        recipe = recipe_of(checkpoint)
        assert isinstance(recipe, SpadRecipe)
        sampling = sampling_of(recipe, PART.prepare(recipe, path.parent, path.parent))
    return Reader(
        sampling=sampling,
        restore=lambda _: network,
        digest=_sampling_digest(sampling, file_digest(path)),
        mac_per_px=network_mac_per_px(network),
    )


def _plain_sampling(sampling: str, request: Request) -> Sampling:
    if sampling == "learned":
        return make_sampling("learned", kernel=read_plate_psf(plate_file()))
    if sampling != "gaussian":
        return make_sampling(cast("Mode", sampling))
    runs = {run.training: run for row in ROWS for run in row.runs if not row.trained_as}
    if finished(request.runs / LIKE_GAUSSIAN) is None:
        return make_sampling("gaussian", sigma=level_sigma(request.options.pictures))
    recipe = recipe_of(read_checkpoint(checkpoint_of(request.runs, runs[LIKE_GAUSSIAN])))
    assert isinstance(recipe, SpadRecipe)
    return make_sampling("gaussian", sigma=recipe.sampling.sigma)


def network_mac_per_px(network: nn.Module) -> float:
    """Count the multiply-adds of a network for a pixel of the array."""
    planes = torch.zeros(1, 2, COST_PX, COST_PX)
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(planes)
    return float(counter.get_total_flops()) / 2 / COST_PX**2


def linear_restorer(believed_sampling: Sampling, exposure: Exposure) -> Restorer:
    """Return the best linear estimate, at the photons that a picture shows.

    Args:
        believed_sampling: How the array is believed to sample, which need not be how it does.
        exposure: Of one sub-pixel.
    """
    covariance = PictureCovariance.of(SuperResolve())
    grid = Grid(scale=SCALE, phase=believed_sampling.phase)
    white = exposure.brighter(believed_sampling.light).white_counts

    def restore(planes: Tensor) -> Tensor:
        photons = float(planes[:, :1].mean()) * white
        estimate = linear_estimate(believed_sampling.kernel, grid, covariance, photons)
        return torch.from_numpy(estimate(planes[0, :1].numpy()))[None]

    return restore


def _bicubic(sampling: Sampling, exposure: Exposure) -> Restorer:
    del exposure
    return bicubic(sampling)


def _sampling_digest(sampling: Sampling, what: str) -> str:
    return digest(sampling.kernel.tobytes(), sampling.phase, sampling.mode, what)


def _train_options(train: ArgumentParser) -> None:
    train.add_argument("--valid", type=Path, help="pictures to choose by")


def _options(measure: ArgumentParser) -> None:
    more: Any = measure.add_argument
    more("--data", type=Path, required=True, help="folder of the test sets")
    more("--pictures", type=Path, help="those trained on, for a Gaussian that is not trained")
    more("--rows", nargs="+", metavar="ROW", help=f"of {', '.join(row.key for row in ROWS)}")


TABLE: Final = Table(
    description=__doc__,
    rows=lambda _: ROWS,
    trainee=trainee,
    add_train_options=_train_options,
    steps=STEPS,
    measure=measure,
    to_text=tables_text,
    add_options=_options,
)

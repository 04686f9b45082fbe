"""Every row on the test sets, at every level of light; finished work is in a journal.

A line of the journal holds as long as nothing changed that decides it: the sampling, the
checkpoint, and the pictures. Networks are run by one thread of torch.
"""

import hashlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Final

import torch
from torch import nn
from torch.utils.flop_counter import FlopCounterMode

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import SETS, bicubic, evaluate_each, read_set
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.recipe import SpadRecipe
from camkit.models_def.kinds.spad.sampling import FULL_LIGHT, Sampling, make_sampling
from camkit.models_def.kinds.spad.training import PART, sampling_of
from camkit.models_def.training.checkpoint import load_network, read_checkpoint, recipe_of
from camkit.models_def.training.kind import Restorer
from camkit.report.journal import append_journal, read_journal
from tools.spad.linear import linear_restorer
from tools.spad.table.judged import GAUSSIAN_UNTRAINED, Judged
from tools.spad.table.training import checkpoint_of, ended, level_sigma, plate_file

JOURNAL: Final = "measured.jsonl"
LEVELS: Final = (math.inf, 1e4, 1e3, 1e2)
"""Photons of white."""
COST_PX: Final = 16
"""Side of the array on which work is counted."""

Tell = Callable[[str], None]
Sets = Mapping[str, Sequence[FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A training, or what needs none, on a set of pictures at a level of light.

    Attributes:
        run: Its name.
        set_name: Of the pictures.
        photons: Of white; None for no noise.
        digest: Of all that decides it.
        psnr_db: Of every picture.
        ssim: Of every picture.
        cpu_s: For all pictures, by one thread.
    """

    run: str
    set_name: str
    photons: float | None
    digest: str
    psnr_db: list[float]
    ssim: list[float]
    cpu_s: float


@dataclass(slots=True, kw_only=True)
class Measured:
    """What was measured.

    Attributes:
        pictures: Set -> how many.
        entries: (run, set, photons) -> entry.
        seeds: Row -> those of its trainings that ended.
        mac_per_px: Row -> multiply-adds per pixel of the array.
        rows_left_out: Row -> why.
        sets_left_out: Set -> why.
    """

    pictures: dict[str, int] = field(default_factory=dict)
    entries: dict[tuple[str, str, float | None], Entry] = field(default_factory=dict)
    seeds: dict[str, tuple[int, ...]] = field(default_factory=dict)
    mac_per_px: dict[str, float] = field(default_factory=dict)
    rows_left_out: dict[str, str] = field(default_factory=dict)
    sets_left_out: dict[str, str] = field(default_factory=dict)


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


def measure_rows(
    rows: Iterable[Judged], runs: Path, data: Path, tell: Tell, pictures: Path | None = None
) -> Measured:
    """Measure every row that is trained.

    Args:
        rows: Those asked for.
        runs: Folder of trainings; the journal lies there.
        data: Folder of the sets.
        tell: Takes a line for everything that was measured.
        pictures: Those trained on, which decide the Gaussian of rows that need no training; None
            takes it from the training of a Gaussian, if there is one.

    Raises:
        ContractError: If there is no set, or one holds no picture.
    """
    found, sets = Measured(), {}
    for name in SETS:
        if (data / name).is_dir():
            sets[name] = read_set(data / name)
            found.pictures[name] = len(sets[name])
        else:
            found.sets_left_out[name] = "there is no such folder"
    if not sets:
        raise ContractError(f"{data} holds none of {', '.join(SETS)}")
    runs.mkdir(parents=True, exist_ok=True)
    journal = runs / JOURNAL
    known = {
        (e.run, e.set_name, e.photons, e.digest): e
        for e in read_journal(journal, lambda line: Entry(**line), "measured row")
    }
    for row in rows:
        seeds = tuple(seed for seed in row.seeds if _is_there(row, seed, runs))
        if not seeds:
            found.rows_left_out[row.key] = "not trained yet"
            continue
        found.seeds[row.key] = seeds
        for seed in seeds:
            reader = _reader(row, seed, runs, pictures)
            if reader.mac_per_px is not None:
                found.mac_per_px[row.key] = reader.mac_per_px
            for entry in _entries(row.run(seed), row, reader, sets, known, journal, tell):
                found.entries[entry.run, entry.set_name, entry.photons] = entry
    return found


def _is_there(row: Judged, seed: int, runs: Path) -> bool:
    return row.trained is None or ended(runs, row.trained, seed) is not None


def _entries(
    run: str,
    row: Judged,
    reader: Reader,
    sets: Sets,
    known: dict[tuple[str, str, float | None, str], Entry],
    journal: Path,
    tell: Tell,
) -> Iterator[Entry]:
    for photons in LEVELS:
        for name, pictures in sets.items():
            told = None if math.isinf(photons) else photons
            digest = _digest(reader.digest, pictures)
            key = (run, name, told, digest)
            if key not in known:
                exposure = Exposure(photons=photons / FULL_LIGHT if row.equal_counts else photons)
                began = time.process_time()
                scores = evaluate_each(
                    pictures, reader.sampling, exposure, reader.restore(exposure)
                )
                entry = Entry(
                    run=run,
                    set_name=name,
                    photons=told,
                    digest=digest,
                    psnr_db=[round(db, 4) for db, _ in scores],
                    ssim=[round(alike, 5) for _, alike in scores],
                    cpu_s=round(time.process_time() - began, 3),
                )
                append_journal(journal, [{n: getattr(entry, n) for n in Entry.__slots__}])
                known[key] = entry
                mean = sum(entry.psnr_db) / len(entry.psnr_db)
                tell(f"{run} on {name}, {told or 'no noise'}: {mean:.2f} dB, {entry.cpu_s:.1f} s")
            yield known[key]


def _reader(row: Judged, seed: int, runs: Path, pictures: Path | None) -> Reader:
    if row.trained is None:
        sampling = _plain_sampling(row, runs, pictures)
        restore = _bicubic if row.method == "bicubic" else linear_restorer
        return Reader(
            sampling=sampling,
            restore=lambda exposure: restore(sampling, exposure),
            digest=_kernel_digest(sampling, row.method),
        )
    path = checkpoint_of(runs, row.trained, seed)
    checkpoint = read_checkpoint(path)
    recipe = recipe_of(checkpoint)
    assert isinstance(recipe, SpadRecipe)
    network = load_network(checkpoint)
    if row.sampling == GAUSSIAN_UNTRAINED:
        sampling = make_sampling("gaussian")
    else:
        sampling = sampling_of(recipe, PART.prepare(recipe, path.parent, path.parent))
    return Reader(
        sampling=sampling,
        restore=lambda _: network,
        digest=_kernel_digest(sampling, _file_digest(path)),
        mac_per_px=network_mac_per_px(network),
    )


def _plain_sampling(row: Judged, runs: Path, pictures: Path | None) -> Sampling:
    if row.sampling == "learned":
        return make_sampling("learned", kernel=read_plate_psf(plate_file()))
    if row.sampling != "gaussian":
        return make_sampling(row.sampling)
    trained = row.like
    if trained is not None and ended(runs, trained, trained.seeds[0]) is not None:
        recipe = recipe_of(read_checkpoint(checkpoint_of(runs, trained, trained.seeds[0])))
        assert isinstance(recipe, SpadRecipe)
        return make_sampling("gaussian", sigma=recipe.sampling.sigma)
    return make_sampling("gaussian", sigma=level_sigma(pictures))


def network_mac_per_px(network: nn.Module) -> float:
    """Count the multiply-adds of a network for a pixel of the array."""
    planes = torch.zeros(1, 2, COST_PX, COST_PX)
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(planes)
    return float(counter.get_total_flops()) / 2 / COST_PX**2


def _bicubic(sampling: Sampling, exposure: Exposure) -> Restorer:
    del exposure
    return bicubic(sampling)


def _kernel_digest(sampling: Sampling, what: str) -> str:
    kernel = sampling.kernel.tobytes() + bytes([sampling.phase])
    return hashlib.sha256(kernel + sampling.mode.encode() + what.encode()).hexdigest()


def _digest(reader: str, pictures: Sequence[FloatArray]) -> str:
    found = hashlib.sha256(reader.encode())
    for picture in pictures:
        found.update(picture.tobytes())
    return found.hexdigest()[:32]


@lru_cache
def _file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()

"""The pool: finished samples on disk, made beside the training and drawn from by step number.

Sample i is a pure function of the recipe, the seed and i; it lies in slot i modulo the size of
the pool. Which samples a step may draw from, and which patches it draws, follows from the step
number alone. So a run that is interrupted and resumed sees the same patches, whatever the worker
had made ahead, and no state of a random generator needs to be kept.

    step t:  [ ........ may be drawn ........ )[ made ahead )
             low(t)                           end(t)        end(t) + AHEAD
"""

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.training.pictures import SceneSource, open_source
from camkit.models_def.training.psf_bank import PsfBank, read_bank, write_bank
from camkit.models_def.training.recipe import Recipe, read_recipe, samples_digest
from camkit.models_def.training.samples import (
    draw_exposure,
    make_sample,
    scene_side_px,
    tint_crop,
)

AHEAD: Final = 32
MAX_WORKERS: Final = 16
PLANES: Final = 9
POLL_S: Final = 0.02
WORKER_MODULE: Final = "camkit.models_def.training.pool_worker"


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Patches of one step: planes (b, 6, p, p), target (b, 3, p, p), weight (b, 3)."""

    planes: Tensor
    target: Tensor
    weight: Tensor


def cut_patch(
    rng: np.random.Generator, planes: NDArray[np.float16], patch_px: int
) -> NDArray[np.float16]:
    """Cut a (9, p, p) patch from the (9, s, s) planes of a sample: random place, turn and flip."""
    room = planes.shape[-1] - patch_px
    y, x = (2 * int(v) for v in rng.integers(0, room // 2 + 1, 2))
    patch = planes[:, y : y + patch_px, x : x + patch_px]
    turned = np.rot90(patch, int(rng.integers(4)), axes=(1, 2))
    return turned[:, :, ::-1] if rng.random() < 0.5 else turned


class SampleMaker:
    """Makes sample i of a recipe; a worker process holds one."""

    def __init__(self, recipe: Recipe, bank: PsfBank, pictures: Path | None, seed: int) -> None:
        self._recipe, self._bank, self._seed = recipe, bank, seed
        data = recipe.data
        self._source: SceneSource = open_source(
            pictures,
            picture_share=data.picture_share,
            scenes=data.procedural_scenes,
            scene_px=data.scene_px,
        )

    def make(self, index: int) -> tuple[NDArray[np.float16], NDArray[np.float32]]:
        """Give the (9, s, s) planes (capture, Wiener, target) and the (3,) weight of sample i."""
        rng = np.random.default_rng((self._seed, index))
        exposure = draw_exposure(rng, self._recipe, self._bank)
        crop = self._source.draw_crop(rng, scene_side_px(self._recipe, self._bank))
        crop = tint_crop(rng, crop)
        sample = make_sample(crop, exposure, self._recipe, self._bank, rng)
        planes = torch.cat([sample.planes, sample.target]).numpy()
        return planes.astype(np.float16), sample.weight.numpy()


class PoolFiles:
    """The memory-mapped files of a pool, shared by trainer and worker.

    `goal[0]` is the sample number up to which the worker may make samples, -1 asks it to stop;
    `cpu_s` is the CPU time of each worker;
    `slots[k]` is 1 + the number of the sample in slot k, 0 while there is none.
    """

    def __init__(self, folder: Path, size: int, side_px: int) -> None:
        self.size, self.side_px = size, side_px
        shape = (size, PLANES, side_px, side_px)
        self.planes: NDArray[np.float16] = _map(folder / "planes.f16", np.float16, shape)
        self.weights: NDArray[np.float32] = _map(folder / "weights.f32", np.float32, (size, 3))
        self.slots: NDArray[np.int64] = _map(folder / "slots.i64", np.int64, (size,))
        self.goal: NDArray[np.int64] = _map(folder / "goal.i64", np.int64, (1,))
        self.cpu_s: NDArray[np.float64] = _map(folder / "cpu.f64", np.float64, (MAX_WORKERS,))

    def next_missing(self, share: tuple[int, int] = (0, 1)) -> int | None:
        """Give the first sample below the goal that is not there; share is (worker, workers)."""
        goal = int(self.goal[0])
        indices = np.arange(max(0, goal - self.size), max(0, goal))
        missing = indices[self.slots[indices % self.size] != indices + 1]
        missing = missing[missing % share[1] == share[0]]
        return int(missing[0]) if missing.size else None

    def are_ready(self, low: int, end: int) -> bool:
        """Tell whether the samples low .. end - 1 are all there."""
        indices = np.arange(low, end)
        return bool((self.slots[indices % self.size] == indices + 1).all())

    def store(self, index: int, planes: NDArray[np.float16], weight: NDArray[np.float32]) -> None:
        """Write a sample; its slot counts as empty while it is being written."""
        slot = index % self.size
        self.slots[slot] = 0
        self.planes[slot] = planes
        self.weights[slot] = weight
        self.slots[slot] = index + 1


class SamplePool:
    """Samples for training; a context manager, since it owns worker processes."""

    def __init__(self, folder: Path, recipe: Recipe, seed: int, maker: SampleMaker) -> None:
        self._folder, self._recipe, self._seed = folder, recipe, seed
        self._files = PoolFiles(folder, recipe.data.pool_samples, recipe.data.sample_px)
        self._maker = maker
        self._workers: list[subprocess.Popen[bytes]] = []
        self.waited_s = 0.0

    def __enter__(self) -> "SamplePool":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def start_workers(self, count: int) -> None:
        """Start processes that make samples beside the training; with none it makes its own.

        Raises:
            ContractError: If there are too many.
        """
        if not 0 <= count <= MAX_WORKERS:
            raise ContractError(f"workers must be 0..{MAX_WORKERS}; got {count}")
        self._files.goal[0] = 0
        self._files.cpu_s[:] = 0
        for number in range(count):
            command = [sys.executable, "-m", WORKER_MODULE, str(self._folder), f"{number}/{count}"]
            # A pipe as stdin tells the worker when this process is gone, however it went.
            self._workers.append(subprocess.Popen(command, stdin=subprocess.PIPE))

    def close(self) -> None:
        """Stop the workers."""
        self._files.goal[0] = -1
        for worker in self._workers:
            if worker.stdin is not None:
                worker.stdin.close()
            worker.wait()
        self._workers.clear()

    def workers_cpu_s(self) -> float:
        """Give the CPU time of the worker processes so far."""
        return float(self._files.cpu_s.sum())

    def span(self, step: int) -> tuple[int, int]:
        """Give the samples (low, end) that a step may draw from."""
        data = self._recipe.data
        end = data.first_samples + step // data.steps_per_sample
        return max(0, end + AHEAD - data.pool_samples), end

    def draw_batch(self, step: int, batch: int, patch_px: int) -> Batch:
        """Draw the patches of a step: random samples, places, turns and flips.

        Raises:
            ContractError: If a worker has died.
        """
        low, end = self.span(step)
        self._ensure(low, end)
        rng = np.random.default_rng((self._seed, 1, step))
        stack = np.empty((batch, PLANES, patch_px, patch_px), dtype=np.float32)
        weights = np.empty((batch, 3), dtype=np.float32)
        for k in range(batch):
            slot = int(rng.integers(low, end)) % self._files.size
            stack[k] = cut_patch(rng, self._files.planes[slot], patch_px)
            weights[k] = self._files.weights[slot]
        planes = torch.from_numpy(stack)
        return Batch(planes=planes[:, :6], target=planes[:, 6:], weight=torch.from_numpy(weights))

    def _ensure(self, low: int, end: int) -> None:
        """Have the samples made, and allow the worker to work ahead."""
        self._files.goal[0] = end + AHEAD
        if self._files.are_ready(low, end):
            return
        start = time.perf_counter()
        while not self._files.are_ready(low, end):
            if not self._workers:
                self._make_missing()
            elif any(worker.poll() is not None for worker in self._workers):
                raise ContractError("a sample worker has ended; its message stands above")
            else:
                time.sleep(POLL_S)
        self.waited_s += time.perf_counter() - start

    def _make_missing(self) -> None:
        index = self._files.next_missing()
        if index is not None:
            self._files.store(index, *self._maker.make(index))


def open_pool(
    folder: Path, recipe_path: Path, bank: PsfBank, pictures: Path | None, *, seed: int
) -> SamplePool:
    """Open the pool of a recipe below a folder, with what it already holds.

    Args:
        folder: Pools of different recipes, kernels or pictures lie in it under different names.
        recipe_path: The recipe.
        bank: Kernels to simulate with.
        pictures: Folder of pictures, None for procedural scenes alone.
        seed: Seed of the samples.
    """
    recipe = read_recipe(recipe_path)
    maker = SampleMaker(recipe, bank, pictures, seed)
    home = pool_folder(folder, recipe, bank, pictures, seed=seed)
    home.mkdir(parents=True, exist_ok=True)
    write_bank(home / "bank.npz", bank)
    (home / "recipe.toml").write_text(recipe_path.read_text(encoding="utf-8"), encoding="utf-8")
    job: dict[str, Any] = {"pictures": None if pictures is None else str(pictures), "seed": seed}
    (home / "job.json").write_text(json.dumps(job), encoding="utf-8")
    return SamplePool(home, recipe, seed, maker)


def pool_folder(
    folder: Path, recipe: Recipe, bank: PsfBank, pictures: Path | None, *, seed: int
) -> Path:
    """Give where the pool of these samples lies."""
    names = "" if pictures is None else ",".join(sorted(p.name for p in pictures.iterdir()))
    parts = (samples_digest(recipe, seed), bank.digest(), names)
    return folder / f"pool-{_short_hash(''.join(parts))}"


def open_job(folder: Path) -> tuple[PoolFiles, SampleMaker]:
    """Open what a worker needs from a pool's folder."""
    recipe = read_recipe(folder / "recipe.toml")
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    pictures = None if job["pictures"] is None else Path(job["pictures"])
    maker = SampleMaker(recipe, read_bank(folder / "bank.npz"), pictures, int(job["seed"]))
    return PoolFiles(folder, recipe.data.pool_samples, recipe.data.sample_px), maker


def _short_hash(text: str) -> str:
    import hashlib

    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _map(path: Path, kind: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Map a file of zeros, made on first use."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    if not path.exists() or path.stat().st_size != size:
        with path.open("wb") as file:
            file.truncate(size)
    return np.memmap(path, dtype=kind, mode="r+", shape=shape)

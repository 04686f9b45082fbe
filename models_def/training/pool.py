"""The pool: finished samples on disk, made beside the training and drawn from by step number.

Sample i is a pure function of the recipe, the material, the seed and i; it lies in slot i modulo
the size of the pool. Which samples a step may draw from, and which patches it draws, follows from
the step number alone. So a run that is interrupted and resumed sees the same patches, whatever the
worker had made ahead, and no state of a random generator needs to be kept.

    step t:  [ ........ may be drawn ........ )[ made ahead )
             low(t)                           end(t)        end(t) + AHEAD
"""

import hashlib
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.training.kind import Material, SampleMaker, read_recipe, training_kind
from camkit.models_def.training.recipe import AHEAD, Recipe
from camkit.models_def.training.sample import Batch, Sample, SampleLayout

MAX_WORKERS: Final = 16
POLL_S: Final = 0.02
RECIPE: Final = "recipe.toml"
JOB: Final = "job.json"
WORKER_MODULE: Final = "camkit.models_def.training.pool_worker"


def cut_patch(
    rng: np.random.Generator,
    planes: NDArray[np.float16],
    target: NDArray[np.float16],
    patch_px: int,
    layout: SampleLayout,
) -> tuple[NDArray[np.float16], NDArray[np.float16]]:
    """Cut one patch from the (c, s, s) inputs and the (c, scale s, scale s) target of a sample.

    At a random place; turned and mirrored at random where the layout allows it.
    """
    room = planes.shape[-1] - patch_px
    y, x = (2 * int(v) for v in rng.integers(0, room // 2 + 1, 2))
    turns, mirrored = 0, False
    if layout.turned:
        turns, mirrored = int(rng.integers(4)), rng.random() < 0.5

    def cut(whole: NDArray[np.float16], scale: int) -> NDArray[np.float16]:
        rows, columns = (slice(scale * v, scale * (v + patch_px)) for v in (y, x))
        turned = np.rot90(whole[:, rows, columns], turns, axes=(1, 2))
        return turned[:, :, ::-1] if mirrored else turned

    return cut(planes, 1), cut(target, layout.scale)


class PoolFiles:
    """The memory-mapped files of a pool, shared by trainer and worker.

    `goal[0]` is the sample number up to which the worker may make samples, -1 asks it to stop;
    `cpu_s` is the CPU time of each worker;
    `slots[k]` is 1 + the number of the sample in slot k, 0 while there is none.
    """

    def __init__(self, folder: Path, size: int, side_px: int, layout: SampleLayout) -> None:
        self.size, self.layout = size, layout
        stored_channels, output_channels = layout.stored_channels, layout.output_channels
        shape, fine = (size, stored_channels, side_px, side_px), layout.scale * side_px
        self.planes: NDArray[np.float16] = _map(folder / "planes.f16", np.float16, shape)
        shape = (size, output_channels, fine, fine)
        self.targets: NDArray[np.float16] = _map(folder / "targets.f16", np.float16, shape)
        self.weights: NDArray[np.float32] = _map(folder / "weights.f32", np.float32, shape[:2])
        self.slots: NDArray[np.int64] = _map(folder / "slots.i64", np.int64, (size,))
        self.goal: NDArray[np.int64] = _map(folder / "goal.i64", np.int64, (1,))
        self.cpu_s: NDArray[np.float64] = _map(folder / "cpu.f64", np.float64, (MAX_WORKERS,))

    def next_missing(self, share: tuple[int, int] = (0, 1)) -> int | None:
        """Return the first sample below the goal that is not there; share is (worker, workers)."""
        goal = int(self.goal[0])
        indices = np.arange(max(0, goal - self.size), max(0, goal))
        missing = indices[self.slots[indices % self.size] != indices + 1]
        missing = missing[missing % share[1] == share[0]]
        return int(missing[0]) if missing.size else None

    def ready(self, low: int, end: int) -> int:
        """Return how many of the samples low .. end - 1 are there."""
        indices = np.arange(low, end)
        return int((self.slots[indices % self.size] == indices + 1).sum())

    def are_ready(self, low: int, end: int) -> bool:
        """Return whether the samples low .. end - 1 are all there."""
        return self.ready(low, end) == end - low

    def store(self, index: int, sample: Sample) -> None:
        """Write a sample; its slot counts as empty while it is being written.

        Raises:
            ContractError: If it is not of the layout of the pool.
        """
        slot, planes = index % self.size, sample.stacked(self.layout)
        self.slots[slot] = 0
        self.planes[slot] = planes.numpy().astype(np.float16)
        self.targets[slot] = sample.target.numpy().astype(np.float16)
        self.weights[slot] = sample.weight.numpy()
        self.slots[slot] = index + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PoolJob:
    """The description of a pool's samples.

    Attributes:
        folder: Where the pool lies.
        recipe: Of any kind.
        role: Whose samples.
        material: What they are made with.
        pictures: Folder of pictures, None for procedural scenes alone.
        seed: Of the samples.
    """

    folder: Path
    recipe: Recipe
    role: str
    material: Material
    pictures: Path | None
    seed: int

    def open(self) -> tuple[PoolFiles, SampleMaker]:
        """Open the files, and the maker that fills them."""
        kind, recipe = training_kind(self.recipe.kind), self.recipe
        layout = kind.layout(recipe, self.role)
        maker = kind.maker(recipe, self.role, self.material, self.pictures, self.seed)
        return PoolFiles(
            self.folder, recipe.data.pool_samples, recipe.data.sample_px, layout
        ), maker


class SamplePool:
    """Samples for training; a context manager, since it owns worker processes."""

    def __init__(self, job: PoolJob, files: PoolFiles, maker: SampleMaker) -> None:
        self._folder, self._recipe, self._seed = job.folder, job.recipe, job.seed
        self._files, self._maker = files, maker
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
        """Start processes that make samples beside the training; without any it makes its own.

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
        self._files.cpu_s[:] = 0  # counted as that of ended children from now on

    def workers_cpu_s(self) -> float:
        """Return the CPU time of the worker processes at work, from their start."""
        return float(self._files.cpu_s.sum())

    def span(self, step: int) -> tuple[int, int]:
        """Return the samples (low, end) that a step may draw from."""
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
        files, layout = self._files, self._files.layout
        fine_px, stored_channels, output_channels = (
            layout.scale * patch_px,
            layout.stored_channels,
            layout.output_channels,
        )
        planes = np.empty((batch, stored_channels, patch_px, patch_px), dtype=np.float32)
        targets = np.empty((batch, output_channels, fine_px, fine_px), dtype=np.float32)
        weights = np.empty((batch, output_channels), dtype=np.float32)
        for k in range(batch):
            slot = int(rng.integers(low, end)) % files.size
            planes[k], targets[k] = cut_patch(
                rng, files.planes[slot], files.targets[slot], patch_px, layout
            )
            weights[k] = files.weights[slot]
        return layout.batch(
            torch.from_numpy(planes), torch.from_numpy(targets), torch.from_numpy(weights)
        )

    def make_ready(self, step: int, go_on: Callable[[int, int], bool]) -> bool:
        """Make the samples of a step, and return whether they are all there.

        Args:
            step: Number of the step.
            go_on: Called with the samples that are there and those in all; False stops.

        Raises:
            ContractError: If a worker has died.
        """
        low, end = self.span(step)
        return self._ensure(low, end, lambda: go_on(self._files.ready(low, end), end - low))

    def _ensure(self, low: int, end: int, go_on: Callable[[], bool] = lambda: True) -> bool:
        """Make sure that the samples exist, and allow the worker to work ahead."""
        self._files.goal[0] = end + AHEAD
        start = time.perf_counter()
        while not self._files.are_ready(low, end):
            if not go_on():
                return False
            if not self._workers:
                self._make_missing()
            elif any(worker.poll() is not None for worker in self._workers):
                raise ContractError("a sample worker has ended; its message stands above")
            else:
                time.sleep(POLL_S)
        self.waited_s += time.perf_counter() - start
        return True

    def _make_missing(self) -> None:
        index = self._files.next_missing()
        if index is not None:
            self._files.store(index, self._maker.make(index))


def open_pool(
    folder: Path,
    recipe_path: Path,
    material: Material,
    pictures: Path | None,
    *,
    seed: int,
    role: str | None = None,
) -> SamplePool:
    """Open the pool of a recipe below a folder, with what it already holds.

    Args:
        folder: Pools of different recipes, material or pictures lie in it under different names.
        recipe_path: The recipe.
        material: Kernels, say, to simulate with.
        pictures: Folder of pictures, None for procedural scenes alone.
        seed: Seed of the samples.
        role: Whose samples; None for a recipe of one role.
    """
    recipe = read_recipe(recipe_path)
    pool_role = recipe.role(role)
    job = PoolJob(
        folder=pool_folder(folder, recipe, pool_role, material, pictures, seed=seed),
        recipe=recipe,
        role=pool_role,
        material=material,
        pictures=pictures,
        seed=seed,
    )
    job.folder.mkdir(parents=True, exist_ok=True)
    files, maker = job.open()
    material.write(job.folder)
    text = recipe_path.read_text(encoding="utf-8")
    (job.folder / RECIPE).write_text(text, encoding="utf-8")
    entries = {
        "pictures": None if pictures is None else str(pictures),
        "seed": seed,
        "role": pool_role,
    }
    (job.folder / JOB).write_text(json.dumps(entries), encoding="utf-8")
    return SamplePool(job, files, maker)


def pool_folder(
    folder: Path,
    recipe: Recipe,
    role: str,
    material: Material,
    pictures: Path | None,
    *,
    seed: int,
) -> Path:
    """Return the folder of the pool of these samples."""
    names = "" if pictures is None else ",".join(sorted(p.name for p in pictures.iterdir()))
    digest = training_kind(recipe.kind).samples_digest(recipe, role, seed)
    return folder / f"pool-{_short_hash(''.join((digest, material.digest(), names)))}"


def read_job(folder: Path) -> PoolJob:
    """Read what a worker needs from a pool's folder."""
    recipe = read_recipe(folder / RECIPE)
    entries = json.loads((folder / JOB).read_text(encoding="utf-8"))
    return PoolJob(
        folder=folder,
        recipe=recipe,
        role=entries["role"],
        material=training_kind(recipe.kind).read_material(folder),
        pictures=None if entries["pictures"] is None else Path(entries["pictures"]),
        seed=int(entries["seed"]),
    )


def _short_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _map(path: Path, kind: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """Map a file of zeros, made on first use."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    if not path.exists() or path.stat().st_size != size:
        with path.open("wb") as file:
            file.truncate(size)
    return np.memmap(path, dtype=kind, mode="r+", shape=shape)

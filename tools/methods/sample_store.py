"""Samples made once and kept, the same for every method, with the kernels of their places.

    recipe -> BayerMaker -> sample i -> slot i of every file

A sample is that of `camkit train` (see `camkit.models_def.kinds.bayer.samples`), and besides it the
capture with its surroundings and the kernels of its block, for networks that know the blur.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.recipe import BayerRecipe, samples_digest
from camkit.models_def.kinds.bayer.samples import finish_shot, layout_of
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.training.pool import cut_patch
from camkit.models_def.training.sample import Batch
from camkit.runtime.output.part_file import atomic_output

FACTS: Final = "samples.json"
KERNELS: Final = "kernels"
NOISE: Final = "noise"
"""Names of masks of a batch: (b, 3, k, k), and (b, 2, 3) shot and read variance."""

Array = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleStore:
    """The files of the samples.

    Attributes:
        recipe: Of the samples.
        stacks: (n, channels, s, s) capture, bank and masks, stabilised.
        targets: (n, 3, s, s).
        weights: (n, 3).
        wide: (n, 3, S, S) capture with its surroundings, stabilised.
        kernels: (n, 3, k, k).
        noise: (n, 2, 3) shot and read variance.
    """

    recipe: BayerRecipe
    stacks: Array
    targets: Array
    weights: Array
    wide: Array
    kernels: Array
    noise: Array

    def draw(self, rng: np.random.Generator, batch: int, patch_px: int) -> Batch:
        """Draw patches for networks that see planes, as a pool of `camkit train` does."""
        layout = layout_of(self.recipe)
        picks = rng.integers(len(self.stacks), size=batch)
        patches = [
            cut_patch(rng, self.stacks[pick], self.targets[pick], patch_px, layout)
            for pick in picks
        ]
        planes, targets = (np.stack(part).astype(np.float32) for part in zip(*patches, strict=True))
        weights = torch.from_numpy(self.weights[picks])
        return layout.batch(torch.from_numpy(planes), torch.from_numpy(targets), weights)

    def draw_blocks(self, rng: np.random.Generator, batch: int, block_px: int) -> Batch:
        """Draw blocks with surroundings, and their kernels, turned and mirrored alike.

        The target is the middle of a block: what the bank keeps of it.
        """
        picks = rng.integers(len(self.wide), size=batch)
        margin = self.recipe.data.margin_px
        room = self.wide.shape[-1] - block_px
        parts: dict[str, list[Array]] = {"capture": [], "target": [], KERNELS: []}
        for pick in picks:
            y, x = (2 * int(v) for v in rng.integers(0, room // 2 + 1, 2))
            inner = block_px - 2 * margin
            turns, mirrored = int(rng.integers(4)), rng.random() < 0.5
            for name, whole in (
                ("capture", self.wide[pick, :, y : y + block_px, x : x + block_px]),
                ("target", self.targets[pick, :, y : y + inner, x : x + inner]),
                (KERNELS, self.kernels[pick]),
            ):
                turned = np.rot90(whole, turns, axes=(1, 2))
                parts[name].append(turned[:, :, ::-1] if mirrored else turned)
        tensors = {
            name: torch.from_numpy(np.stack(part).astype(np.float32))
            for name, part in parts.items()
        }
        return Batch(
            inputs={"capture": tensors["capture"]},
            target=tensors["target"],
            weight=torch.from_numpy(self.weights[picks]),
            masks={KERNELS: tensors[KERNELS], NOISE: torch.from_numpy(self.noise[picks])},
        )


def open_store(
    folder: Path,
    recipe: BayerRecipe,
    material: BayerMaterial,
    pictures: Path | None,
    count: int,
    tell: Callable[[int], None] = lambda _: None,
) -> SampleStore:
    """Open the samples of a folder; those that are missing are made.

    Args:
        folder: Of the samples.
        recipe: Of a camera behind a mosaic.
        material: Kernels.
        pictures: Scenes; None for procedural ones alone.
        count: Number of samples.
        tell: Told the number of every sample that is made.

    Raises:
        ContractError: If the folder holds others.
    """
    folder.mkdir(parents=True, exist_ok=True)
    seed = recipe.network("M").schedule.seed
    facts = {
        "samples": samples_digest(recipe, seed),
        "kernels": material.digest(),
        "pictures": None if pictures is None else sorted(path.name for path in pictures.iterdir()),
        "count": count,
    }
    path = folder / FACTS
    saved: dict[str, Any] = facts | {"made": 0}
    if path.is_file():
        saved = json.loads(path.read_text(encoding="utf-8"))
    if {name: saved[name] for name in facts} != facts:
        raise ContractError(f"{folder} holds other samples: remove it, or name another --work-dir")
    store = _mapped(folder, recipe, material, count)
    maker = BayerMaker(recipe, material.bank, pictures, seed)
    for number in range(saved["made"], count):
        _make(store, maker, number)
        with atomic_output(path) as part:
            part.write_text(json.dumps(facts | {"made": number + 1}), encoding="utf-8")
        tell(number + 1)
    return store


def _mapped(folder: Path, recipe: BayerRecipe, material: BayerMaterial, count: int) -> SampleStore:
    side, layout = recipe.data.sample_px, layout_of(recipe)
    whole = side + 2 * recipe.data.margin_px
    shapes: dict[str, tuple[type, tuple[int, ...]]] = {
        "stacks": (np.float16, (layout.stored_channels, side, side)),
        "targets": (np.float16, (3, side, side)),
        "weights": (np.float32, (3,)),
        "wide": (np.float16, (3, whole, whole)),
        KERNELS: (np.float32, material.bank.frozen.shape[1:]),
        NOISE: (np.float32, (2, 3)),
    }
    arrays: dict[str, Any] = {}
    for name, (kind, shape) in shapes.items():
        path = folder / f"{name}.raw"
        mode: Any = "r+" if path.is_file() else "w+"
        arrays[name] = np.memmap(path, dtype=kind, mode=mode, shape=(count, *shape))
    return SampleStore(recipe=recipe, **arrays)


def _make(store: SampleStore, maker: BayerMaker, number: int) -> None:
    developed = maker.developed(number)
    sample = finish_shot(developed, store.recipe).sample
    noise = developed.circumstances.noise
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    wide = stabilise(developed.planes, shot, read, scale=store.recipe.scale)
    store.stacks[number] = sample.stacked(layout_of(store.recipe)).numpy()
    store.targets[number], store.weights[number] = sample.target.numpy(), sample.weight.numpy()
    store.wide[number] = wide[0].numpy()
    store.kernels[number] = developed.circumstances.frozen[0].numpy()
    store.noise[number] = np.stack([noise.shot, noise.read_variance])

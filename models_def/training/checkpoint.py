"""Checkpoints: everything a run needs to go on, and everything an export needs to know.

Plain numbers, strings and tensors only, so that torch's weights-only reader takes them; a file
is complete or absent (written beside, then renamed).
"""

import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.bundle.reader import PRESCRIPTION
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.errors import ContractError
from camkit.models_def.torch_file import load_torch
from camkit.models_def.training.kind import to_recipe, training_kind
from camkit.models_def.training.recipe import Recipe

FORMAT: Final = 1

State = dict[str, Tensor]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """One moment of a training run.

    Attributes:
        recipe_toml: The recipe as text.
        designed: Its optics as designed, as a bundle holds them: name of a member -> content; empty
            where there are none, and in checkpoints of before.
        role: Which of its networks.
        size: In which size.
        network: Name by which its kind builds it.
        config: What of its config differs from the defaults.
        bank_digest: sha256 of the material trained with: kernels, say.
        training_data: What the weights were trained on, for the card.
        step: Steps done.
        elapsed_s: Wall time so far.
        cpu_s: CPU time so far, workers included.
        valid_db: Last validation PSNR of the average, None before the first.
        weights: The weights that are being trained.
        average: Their average, which is validated.
        optimizer: State of AdamW.
        best: The average that validated best; empty before the first validation, and in
            checkpoints of before.
        best_db: What it validated at.
    """

    recipe_toml: str
    size: str
    network: str
    config: dict[str, Any]
    bank_digest: str
    training_data: str
    step: int
    elapsed_s: float
    cpu_s: float
    valid_db: float | None
    weights: State
    average: State
    optimizer: dict[str, Any]
    designed: dict[str, bytes] = field(default_factory=dict)
    role: str = DEFAULT_ROLE
    best: State = field(default_factory=dict)
    best_db: float | None = None

    @property
    def exported(self) -> State:
        """Return the weights that are exported and that others begin with."""
        return self.best or self.average


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint; an interrupted write leaves the old file."""
    table = {f.name: getattr(checkpoint, f.name) for f in fields(checkpoint)}
    # the reader of weights alone takes text and tensors, no bytes
    table["designed"] = {
        name: torch.from_numpy(np.frombuffer(data, np.uint8).copy())
        for name, data in checkpoint.designed.items()
    }
    write_table(path, {"format": FORMAT} | table)


def write_table(path: Path, table: dict[str, Any]) -> None:
    """Write what `read_table` reads; an interrupted write leaves the old file."""
    part = path.with_name(path.name + ".part")
    torch.save(table, part)
    part.replace(path)


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint without running any code from it.

    Raises:
        ContractError: If it is missing, no checkpoint, or of another format.
    """
    return to_checkpoint(path, read_table(path))


def read_table(path: Path) -> dict[str, Any]:
    """Read what torch saved, tensors and plain values only; no code from it runs.

    Raises:
        ContractError: If it is missing or something else.
    """
    table = load_torch(path, "checkpoint of camkit")
    if not isinstance(table, dict) or "format" not in table:
        raise ContractError(
            f"{path} is no checkpoint of camkit; a network of your own comes in by "
            "`camkit network add`"
        )
    return table


def to_checkpoint(path: Path, table: dict[str, Any]) -> Checkpoint:
    """Make the checkpoint of training from the content of a file.

    Raises:
        ContractError: If it is of another format.
    """
    entries = {"designed": {}, "role": DEFAULT_ROLE, "best": {}, "best_db": None} | table
    if entries.pop("format", None) != FORMAT:
        raise ContractError(f"{path} is no checkpoint of format {FORMAT}; train again")
    lens_toml = entries.pop("lens_toml", "")  # what older ones have in place of `designed`
    missing = {f.name for f in fields(Checkpoint)} ^ set(entries)
    if missing:
        raise ContractError(f"checkpoint {path} has wrong entries: {', '.join(sorted(missing))}")
    designed = _designed(path, entries.pop("designed"))
    if lens_toml:
        designed = {PRESCRIPTION: lens_toml.encode()}
    return Checkpoint(**entries, designed=designed)


def _designed(path: Path, entry: Any) -> dict[str, bytes]:
    """Return the bytes of what was written as tensors.

    Raises:
        ContractError: If it was not.
    """
    is_bytes = isinstance(entry, dict) and all(
        isinstance(data, Tensor) and data.dtype == torch.uint8 for data in entry.values()
    )
    if not is_bytes:
        raise ContractError(f"checkpoint {path} has wrong entries: designed")
    return {name: data.numpy().tobytes() for name, data in entry.items()}


def recipe_of(checkpoint: Checkpoint) -> Recipe:
    """Return the recipe that a checkpoint carries; raises as `read_recipe` does."""
    return to_recipe(tomllib.loads(checkpoint.recipe_toml))


def load_network(checkpoint: Checkpoint) -> nn.Module:
    """Build the network with the chosen weights, ready to export.

    Raises:
        ContractError: If the weights do not fit the network.
    """
    kind = training_kind(recipe_of(checkpoint).kind)
    network = kind.build_network(checkpoint.network, **checkpoint.config)
    try:
        network.load_state_dict(checkpoint.exported)
    except RuntimeError as error:
        raise ContractError(f"the weights do not fit {checkpoint.network}: {error}") from error
    return network.eval()

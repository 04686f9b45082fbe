"""Instance norms of a trained network become constants, so that it may be exported.

checkpoint with live norms + calibration samples -> checkpoint of its twin with frozen ones, judged

The twin is the same network with `frozen = true` in its configuration; it is exported, and may be
trained further (`camkit train --start`), like any other.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.networks.instance_norm import freeze_norms, live_norms
from camkit.models_def.training.checkpoint import (
    Checkpoint,
    load_network,
    read_checkpoint,
    write_checkpoint,
)
from camkit.models_def.training.kind import Material, Restorer, read_recipe, training_kind
from camkit.models_def.training.pictures import list_pictures
from camkit.progress import counted, working

FIRST_SAMPLE: Final = 50_000_000
"""Number of the first calibration sample: noise and place of none are those of training; tiles of
frames are the same ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreezeOptions:
    """The settings of freezing norms.

    Attributes:
        pictures: Folder that calibration samples are cut from; None for procedural scenes.
        valid: Folder of pictures to state the cost on; None for procedural scenes.
        cache_folder: Where traced kernels are kept.
        samples: For calibration.
    """

    pictures: Path | None
    valid: Path | None
    cache_folder: Path
    samples: int = 64

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise ContractError(f"samples must be >= 1; got {self.samples}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrozenReport:
    """The frozen norms, and their cost.

    Attributes:
        norms: How many.
        samples: That their constants are means over.
        live_db: Validation dB with norms that look at each picture.
        frozen_db: The same with constants.
    """

    norms: int
    samples: int
    live_db: float
    frozen_db: float

    def to_json(self) -> dict[str, Any]:
        """Return the report as a flat mapping."""
        return {
            "norms": self.norms,
            "samples": self.samples,
            "live_db": round(self.live_db, 3),
            "frozen_db": round(self.frozen_db, 3),
            "cost_db": round(self.live_db - self.frozen_db, 3),
        }


def freeze_checkpoint(
    recipe_path: Path,
    source: Path,
    out: Path,
    options: FreezeOptions,
    *,
    material: Material | None = None,
) -> FrozenReport:
    """Freeze the norms of a checkpoint and write its twin.

    Args:
        recipe_path: Of the camera that samples are made with.
        source: A checkpoint of `camkit train` whose network has live norms.
        out: The checkpoint to write.
        options: Pictures and numbers.
        material: What samples are made with; None has the kind prepare it.

    Raises:
        ContractError: If the checkpoint has no norms to freeze, or was trained with other kernels,
            or a folder holds no pictures.
    """
    for folder in (options.pictures, options.valid):
        list_pictures(folder)  # before anything is traced
    saved = read_checkpoint(source)
    recipe = read_recipe(recipe_path)
    kind, seed = training_kind(recipe.kind), recipe.network(saved.size, saved.role).schedule.seed
    live = load_network(saved)
    if not live_norms(live):
        raise ContractError(f"{source} holds no norms that look at a picture; export it as it is")
    config = saved.config | {"frozen": True}
    try:
        frozen = kind.build_network(saved.network, **config).eval()
    except ContractError as error:
        raise ContractError(
            f"{source} holds a {saved.network}, which has no form with constants in place of its "
            "norms; normed_unet has one"
        ) from error
    if material is None:
        options.cache_folder.mkdir(parents=True, exist_ok=True)
        with working(f"preparing the kernels of {recipe.name}"):
            material = kind.prepare(recipe, recipe_path.parent, options.cache_folder)
    if material.digest() != saved.bank_digest:
        raise ContractError(f"{source} was trained with other kernels than those of {recipe_path}")
    layout = kind.layout(recipe, saved.role)
    maker = kind.maker(recipe, saved.role, material, options.pictures, seed)
    numbers = range(FIRST_SAMPLE, FIRST_SAMPLE + options.samples)
    making = counted(numbers, "making samples", "samples")
    pictures = [maker.make(number).stacked(layout)[None] for number in making]
    with working("freezing the norms"):
        norms = freeze_norms(live, frozen, pictures)
    with working("judging the network with live and with frozen norms"):
        judge = kind.judge(recipe, saved.role, material, options.valid)
        report = FrozenReport(
            norms=norms,
            samples=options.samples,
            live_db=judge.score(_restorer(live)).mean_db,
            frozen_db=judge.score(_restorer(frozen)).mean_db,
        )
    write_checkpoint(out, _twin(saved, config, frozen, report))
    return report


def _restorer(network: nn.Module) -> Restorer:
    def restore(planes: Tensor) -> Tensor:
        with torch.no_grad():
            return torch.as_tensor(network(planes))

    return restore


def _twin(
    saved: Checkpoint, config: dict[str, Any], frozen: nn.Module, report: FrozenReport
) -> Checkpoint:
    """Return the checkpoint of the frozen network; it cannot be resumed, only begun from."""
    state = {name: tensor.clone() for name, tensor in frozen.state_dict().items()}
    cost_db = report.live_db - report.frozen_db
    return replace(
        saved,
        config=config,
        weights=state,
        average=state,
        optimizer={},
        best={},
        best_db=None,
        valid_db=report.frozen_db,
        training_data=f"{saved.training_data}; norms frozen with {report.samples} samples for "
        f"{cost_db:.2f} dB",
    )

"""Later training of a trained network, for the kinds that have one.

The part of such a kind defines `REFINING` beside its `PART`, which fulfils `RefiningKind`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from camkit.errors import UnsupportedError
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.kind import special_part
from camkit.models_def.training.recipe import NetworkRecipe, ScheduleRecipe


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """Later training of a trained network, with its own files, schedule and fitter.

    Attributes:
        name: Behind the size in the names of its files.
        schedule: Used instead of the network's.
        make_fitter: From the network's entry, with that schedule, and the material.
        first: Weights that the fitter starts from.
        credit: What it adds to the training data, for the card.
    """

    name: str
    schedule: ScheduleRecipe
    make_fitter: Callable[[NetworkRecipe, Any], Fitter]
    first: FirstWeights | None = None
    credit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuningOptions:
    """The options of fine-tuning.

    Attributes:
        start: Checkpoint or bundle to start from.
        size: Which network of the recipe; of a bundle with several, that of the same name.
        vgg: Weights of VGG-19; None compares sRGB values instead of features.
        pairs: Folder of real pairs.
        device: cpu or cuda.
        recipe_folder: For a lens that the recipe names by its path.
    """

    start: Path
    size: str
    vgg: Path | None = None
    pairs: Path | None = None
    device: str = "cpu"
    recipe_folder: Path = Path()


class RefiningKind(Protocol):
    """A kind of camera whose networks can be fine-tuned."""

    def refinement(self, recipe: Any, options: FineTuningOptions) -> Refinement:
        """Prepare the fine-tuning of a recipe; raise ContractError if a file is wrong."""
        ...


def refining_kind(name: str) -> RefiningKind:
    """Return the part of a kind that fine-tunes.

    Raises:
        UnsupportedError: If its networks are not fine-tuned.
    """
    part: RefiningKind | None = special_part(name, "REFINING")
    if part is None:
        raise UnsupportedError(f"networks of the kind {name!r} are not fine-tuned")
    return part

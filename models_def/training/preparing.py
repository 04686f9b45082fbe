"""Samples made before training, for the kinds that photograph whole frames.

The part of such a kind defines `PREPARING` beside its `PART`, which fulfils `PreparingKind`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from camkit.errors import UnsupportedError
from camkit.models_def.training.kind import special_part

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class PrepareOptions:
    """The options of a preparation besides the recipe.

    Attributes:
        psf: Core kernels of the lens as designed.
        haze: The haze beside them.
        pictures: Folder of pictures to train on; None for procedural scenes alone.
        valid: Folder of pictures to choose by; likewise.
        recipe_folder: For a lens that the recipe names by its path.
        runs: Folder of the runs.
        seed: Of scenes, places and noise.
    """

    psf: Path
    haze: Path
    pictures: Path | None
    valid: Path | None
    recipe_folder: Path
    runs: Path
    seed: int = 0


class PreparingKind(Protocol):
    """A kind of camera whose samples are prepared."""

    def written_last(self, recipe: Any, runs: Path) -> Path:
        """Return the last of the files; raise ContractError if there is nothing to do.

        Args:
            recipe: Of the kind.
            runs: Folder of the runs.
        """
        ...

    def prepare(self, recipe: Any, options: PrepareOptions, tell: Tell) -> dict[str, Any]:
        """Make the files and return a report; raise ContractError if a source is missing."""
        ...


def preparing_kind(name: str) -> PreparingKind:
    """Return the part of a kind that prepares.

    Raises:
        UnsupportedError: If its samples are made while it trains.
    """
    part: PreparingKind | None = special_part(name, "PREPARING")
    if part is None:
        raise UnsupportedError(
            f"samples of the kind {name!r} are made while it trains; leave prepare out"
        )
    return part

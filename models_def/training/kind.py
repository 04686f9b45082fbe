"""The interface between training and a kind of camera: scenes, samples, judgement.

    recipe -> training_kind -> TrainingKind -> prepare   material: what samples are made with
                                            -> maker     sample i of a role
                                            -> judge     fixed captures to choose by

A kind's part of the design side (`camkit.models_def.kinds.NAME`, or the `models_def` of its own
package) defines `PART`, which fulfils `TrainingKind`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from torch import Tensor, nn

from camkit.bundle.stages import Stage
from camkit.errors import ContractError
from camkit.kinds import find_kind
from camkit.models_def.toml_table import faults_of, typed
from camkit.models_def.training.recipe import DEFAULT_KIND, Recipe, with_new_names
from camkit.models_def.training.sample import Finish, Sample, SampleLayout
from camkit.side_file import read_side_toml

Restorer = Callable[[Tensor], Tensor]
"""(1, c, h, w) of all inputs -> (1, c, scale h, scale w) of all outputs."""

_OLDER: Mapping[str, str] = {"camera": "sensor"}

R = TypeVar("R", bound=Recipe)
M = TypeVar("M", bound="Material")


class Material(Protocol):
    """The material of samples, prepared once: the kernels of a lens, say."""

    @property
    def designed(self) -> Mapping[str, bytes]:
        """Return its optics as designed, as a bundle holds them: name of a member -> content.

        A lens is `prescription.toml`, a plate `plate.toml`; empty where there is neither.
        """
        ...

    def digest(self) -> str:
        """Return the sha256 of all that decides samples."""
        ...

    def write(self, folder: Path) -> None:
        """Write it for another process."""
        ...


class SampleMaker(Protocol):
    """Makes the samples of one role; a worker process holds one."""

    def make(self, index: int) -> Sample:
        """Make sample i: a pure function of recipe, material, seed and i."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """The score of a network.

    Attributes:
        mean_db: Over all captures.
        parts: What is told apart -> value -> dB; "by_iso" -> "100" -> 31.2.
    """

    mean_db: float
    parts: Mapping[str, Mapping[str, float]]


def mean_score(every_db: Sequence[float], **labels: Sequence[str]) -> Score:
    """Return the mean over captures, and over those of each label.

    Args:
        every_db: Of the captures.
        labels: What is told apart -> its value for every capture; by_iso=("100", "800", ...).
    """
    parts = {
        name: {
            label: float(
                np.mean([db for db, value in zip(every_db, each, strict=True) if value == label])
            )
            for label in dict.fromkeys(each)
        }
        for name, each in labels.items()
    }
    return Score(mean_db=float(np.mean(every_db)), parts=parts)


class Judge(Protocol):
    """Fixed captures that are never trained on."""

    def baselines(self) -> Mapping[str, float]:
        """Return the baselines of a network: name -> mean dB."""
        ...

    def score(self, restore: Restorer) -> Score:
        """Compute the score of a restoration."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A camera as its bundle will state it, but for what is measured at export.

    Attributes:
        stages: In order; the last gives the product `image`.
        products: Further results: name -> plane.
        object_distance_mm: Distance of focus from the first surface.
        fails_on: For its card: what it fails on, besides objects at other depths.
    """

    stages: tuple[Stage, ...]
    products: Mapping[str, str] = field(default_factory=dict)
    object_distance_mm: float = math.inf
    fails_on: tuple[str, ...] = ()


class TrainingKind(Protocol[R, M]):
    """A kind of camera as training sees it."""

    @property
    def roles(self) -> tuple[str, ...]:
        """Roles of its networks, in the order in which a picture meets them."""
        ...

    @property
    def camera_parts(self) -> tuple[str, ...]:
        """Attributes of its recipe that say which camera it is, not how it is trained."""
        ...

    def to_recipe(self, table: Mapping[str, Any]) -> R:
        """Check the tables of a recipe; raise ContractError naming the key."""
        ...

    def design(self, recipe: R) -> Design:
        """Return the camera as its bundle will state it."""
        ...

    def build_network(self, name: str, **config: Any) -> nn.Module:
        """Build an untrained network with the attribute `stride_px`; see `build_network`."""
        ...

    def layout(self, recipe: R, role: str) -> SampleLayout:
        """Return the layout of a role's samples, and so the inputs and outputs of its networks."""
        ...

    def finish(self, recipe: R, role: str) -> Finish | None:
        """Return the stage that follows the network of a role; None for none."""
        ...

    def prepare(self, recipe: R, recipe_folder: Path, cache_folder: Path) -> M:
        """Prepare what samples need; what takes long is kept in the cache."""
        ...

    def read_material(self, folder: Path) -> M:
        """Read what `Material.write` wrote."""
        ...

    def samples_digest(self, recipe: R, role: str, seed: int) -> str:
        """Return a hash of all in the recipe that decides the samples, to name their pool by."""
        ...

    def maker(
        self, recipe: R, role: str, material: M, pictures: Path | None, seed: int
    ) -> SampleMaker:
        """Open the scenes and return the maker of a role's samples."""
        ...

    def judge(self, recipe: R, role: str, material: M, pictures: Path | None) -> Judge:
        """Make the captures that a role is judged by; of procedural scenes without pictures."""
        ...


def training_kind(name: str) -> TrainingKind[Any, Any]:
    """Return the part of a kind that training asks.

    Raises:
        UnsupportedError: If there is no such kind, or it cannot be trained.
        ContractError: If its part defines no PART.
    """
    part = find_kind(name).part("models_def")
    if not hasattr(part, "PART"):
        raise ContractError(f"{part.__name__} must define PART as a TrainingKind")
    return cast("TrainingKind[Any, Any]", part.PART)


def special_part(kind: str, name: str) -> Any | None:
    """Return what the design side of a kind defines beside its `PART`; None if it does not.

    Args:
        kind: Name of the kind.
        name: FITTING, REFINING, BANK_FITTING, PREPARING, or DESIGNED, a function of a recipe and
            its folder that returns what `Material.designed` does.

    Raises:
        UnsupportedError: If there is no such kind, or it cannot be trained.
    """
    return getattr(find_kind(kind).part("models_def"), name, None)


def read_recipe(path: Path) -> Recipe:
    """Read and check a recipe of any kind.

    Raises:
        ContractError: If the file is missing, is no TOML, or a key is unknown, missing or wrong.
        UnsupportedError: If its kind cannot be trained.
    """
    table = read_side_toml(path, "recipe")
    with faults_of(f"recipe {path}"):
        return to_recipe(table)


def to_recipe(table: Mapping[str, Any]) -> Recipe:
    """Convert a parsed TOML table to the recipe of its kind; raises as `read_recipe` does."""
    kind = typed("kind", table.get("kind", DEFAULT_KIND), str)
    recipe: Recipe = training_kind(kind).to_recipe(with_new_names(table, _OLDER))
    return recipe


def build_role(
    kind: TrainingKind[R, M], recipe: R, role: str, size: str
) -> tuple[nn.Module, SampleLayout]:
    """Build the untrained network of a role and size, and return its layout too."""
    entry = recipe.network(size, role)
    return kind.build_network(entry.network, **entry.config), kind.layout(recipe, role)

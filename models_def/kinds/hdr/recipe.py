"""Recipes of snapshot HDR cameras: a plate, a sensor, and scenes with lights."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from camkit.bundle.sensor import BayerSensor
from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis_recipe import GlareRecipe, ThesisRecipe
from camkit.models_def.toml_table import section, table_digest, typed
from camkit.models_def.training.recipe import (
    DataRecipe,
    Recipe,
    check_share,
    common_tables,
    mosaic_sensor,
)

ROLES: Final = ("highlights",)
REFERENCE_ROLES: Final = ("split", "highlight", "fusion", "whole")
"""Of networks that are compared with, see `thesis`; no bundle holds them."""
OWN_KEYS: Final = ("object_distance_mm", "scale", "plate", "thesis", "glare")
CAMERA_PARTS: Final = ("name", "object_distance_mm", "scale", "sensor", "plate")
"""What says which camera it is; how its networks are trained may differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateRecipe:
    """The plate, and how finely it is computed.

    Attributes:
        file: Name of a built-in plate, or path of a TOML file relative to the recipe.
        side_px: Side of the kernels from which its streaks are told, odd.
    """

    file: str
    side_px: int = 401

    def __post_init__(self) -> None:
        if self.side_px < 65 or self.side_px % 2 == 0:
            raise ContractError(f"plate.side_px must be odd, 65 or more; got {self.side_px}")


@dataclass(frozen=True, slots=True, kw_only=True)
class HdrDataRecipe(DataRecipe):
    """The settings of training samples.

    Attributes:
        capture_px: Side of the simulated capture in which lights are sought; a sample is cut
            from it.
        surround_px: Scene around the capture, whose lights fall into it too.
        saturated_min: Least share of a scene that saturates, drawn log-uniformly.
        saturated_max: Greatest share.
        as_it_is_share: Share of scenes that are not exposed for saturation but as they are: few
            and faint lights.
        iso_min: Lowest ISO, drawn log-uniformly.
        iso_max: Highest ISO.
        light_share: Share of samples that are cut about a light, the others anywhere.
    """

    capture_px: int = 512
    surround_px: int = 96
    saturated_min: float = 0.001
    saturated_max: float = 0.06
    as_it_is_share: float = 0.2
    iso_min: float = 80.0
    iso_max: float = 3200.0
    light_share: float = 0.9

    def __post_init__(self) -> None:
        DataRecipe.__post_init__(self)
        check_share("data.as_it_is_share", self.as_it_is_share)
        check_share("data.light_share", self.light_share)
        if self.capture_px < self.sample_px or self.surround_px < 0 or self.capture_px % 2:
            raise ContractError(
                "data.capture_px must be even and hold a sample, surround_px be >= 0; got "
                f"{self.capture_px}, {self.surround_px}"
            )
        if not 0 < self.saturated_min <= self.saturated_max < 1:
            raise ContractError("data.saturated_min must lie in (0, saturated_max], below 1")
        if not 0 < self.iso_min <= self.iso_max:
            raise ContractError(f"data.iso_min must be in (0, iso_max]; got {self.iso_min}")


@dataclass(frozen=True, slots=True, kw_only=True)
class HdrRecipe(Recipe):
    """A snapshot HDR camera and how its networks are trained.

    Attributes:
        sensor: With a mosaic and the response of its colours.
        data: How samples are made.
        object_distance_mm: Distance the lens is focused on; inf is allowed.
        scale: Divisor of the stabilised planes, see the manifest.
        plate: What stands before the lens.
        thesis: How the networks of the thesis are trained.
        glare: Of a windshield, where `thesis` says so.
    """

    sensor: BayerSensor
    data: HdrDataRecipe
    object_distance_mm: float
    scale: float
    plate: PlateRecipe
    thesis: ThesisRecipe = field(default_factory=ThesisRecipe)
    glare: GlareRecipe = field(default_factory=GlareRecipe)


def to_hdr_recipe(table: Mapping[str, Any]) -> HdrRecipe:
    """Convert a parsed TOML table to a recipe.

    Raises:
        ContractError: If a key is unknown, missing or wrong, or the sensor has no mosaic.
    """
    common = common_tables(
        table, kind_keys=OWN_KEYS, roles=(*ROLES, *REFERENCE_ROLES), main=ROLES[0]
    )
    return HdrRecipe(
        name=common.name,
        kind=common.kind,
        sensor=mosaic_sensor(common.sensor),
        networks=common.networks,
        object_distance_mm=typed("object_distance_mm", table.get("object_distance_mm"), float),
        scale=typed("scale", table.get("scale", 64.0), float),
        plate=section("plate", PlateRecipe, table.get("plate", {})),
        data=section("data", HdrDataRecipe, table.get("data", {})),
        thesis=section("thesis", ThesisRecipe, table.get("thesis", {})),
        glare=section("glare", GlareRecipe, table.get("glare", {})),
    )


def samples_digest(recipe: HdrRecipe, seed: int) -> str:
    """Return a hash of all that decides the training samples, to name their pool by."""
    content = {
        "sensor": recipe.sensor.model_dump(mode="json"),
        "plate": asdict(recipe.plate),
        "data": asdict(recipe.data),
        "scale": recipe.scale,
        "object_distance_mm": str(recipe.object_distance_mm),
        "seed": seed,
    }
    return table_digest(content)


def reference_digest(recipe: HdrRecipe, role: str, seed: int) -> str:
    """Return a hash of all that decides the samples of a reference role."""
    settings = {"role": role, "optics": recipe.thesis.optics}
    if recipe.thesis.optics == "glare":
        settings |= {key: str(value) for key, value in asdict(recipe.glare).items()}
    text = samples_digest(recipe, seed) + json.dumps(settings, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()

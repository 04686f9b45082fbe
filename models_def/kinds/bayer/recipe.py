"""Recipes: what a person edits to train the networks of a camera, read from TOML.

Keys are strict: an unknown or missing key, a wrong type or a value out of range is an error that
names the key.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ValidationError

from camkit.bundle.camera import Camera
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.models_def.toml_table import check_keys, read_table, section, typed

LOSSES = ("log_mse", "mse")
PRECISIONS = ("float32", "bfloat16")

M = TypeVar("M", bound=BaseModel)


def _check_share(where: str, value: float) -> None:
    if not 0 <= value <= 1:
        raise ContractError(f"{where} must lie in 0..1; got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class LensRecipe:
    """The lens and how far its copies vary.

    Attributes:
        prescription: Name of a built-in lens, or path of a file (.toml, .zmx) relative to the
            recipe.
        copies: Fabricated copies whose PSFs are trained on; one more is kept for validation.
        fields: Field heights of the kernel bank.
        kernel_px: Side of its kernels, odd.
        rays: Rays in half the pupil.
        seed: Seed of the fabrication errors.
        depths_mm: Object distances, increasing, with the sensor where the prescription has it; a
            sample is taken at one of them by chance, the Wiener filter has their mean kernel.
            Empty for the distance of the prescription.
    """

    prescription: str
    copies: int = 8
    fields: int = 25
    kernel_px: int = 129
    rays: int = 4096
    seed: int = 101
    depths_mm: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if any(near >= far for near, far in pairwise((0.0, *self.depths_mm))):
            raise ContractError(f"lens.depths_mm must increase from above 0; got {self.depths_mm}")

    def to_json(self) -> dict[str, Any]:
        """Give what decides the kernels, to name files by; depths only where there are any."""
        return {name: value for name, value in asdict(self).items() if value != ()}


@dataclass(frozen=True, slots=True, kw_only=True)
class DataRecipe:
    """How training samples are made.

    Attributes:
        picture_share: Share of samples cut from pictures, the rest is procedural; without a
            folder of pictures every sample is procedural.
        procedural_scenes: Different procedural scenes of `scene_px` a side.
        scene_px: Side of a procedural scene.
        sample_px: Side of a finished sample; training patches are cut from it.
        margin_px: Simulated surroundings of a sample that the Wiener filter sees.
        pool_samples: Samples held on disk at one time.
        first_samples: Samples that must exist before the first step.
        steps_per_sample: Training steps after which one more sample replaces the oldest.
        iso_min: Lowest ISO, drawn log-uniformly.
        iso_max: Highest ISO.
        exposure_min_ev: Least exposure relative to the picture as it is.
        exposure_max_ev: Greatest exposure; above 0 highlights clip.
        block_jitter_px: How far the block centre whose kernel filters a patch may lie from it.
        border_share: Share of samples that lie at one or more picture borders.
        drift_share: Share of samples whose lens has drifted since it was measured: its kernels
            are scaled and turned, each uniformly within the two limits below.
        drift_scale: Largest relative change of the kernels' size, by heat or refocusing.
        drift_turn_deg: Largest turn of the kernels, by a lens turned in its mount.
        target_max: Targets are clipped at this multiple of the white level.
        depth_shares: How often each of `lens.depths_mm` is drawn, relative to the others; empty
            for equally often.
        known_depth_share: Share of samples whose Wiener filter has the kernel of their depth, as
            `camkit process --depth-m` gives it; the others' has the mean kernel.
    """

    picture_share: float = 0.8
    procedural_scenes: int = 48
    scene_px: int = 1024
    sample_px: int = 256
    margin_px: int = 72
    pool_samples: int = 1600
    first_samples: int = 400
    steps_per_sample: int = 8
    iso_min: float = 80.0
    iso_max: float = 6400.0
    exposure_min_ev: float = -3.0
    exposure_max_ev: float = 1.0
    block_jitter_px: float = 176.0
    border_share: float = 0.2
    drift_share: float = 0.0
    drift_scale: float = 0.05
    drift_turn_deg: float = 5.0
    target_max: float = 4.0
    depth_shares: tuple[float, ...] = ()
    known_depth_share: float = 0.0

    def __post_init__(self) -> None:
        _check_share("data.known_depth_share", self.known_depth_share)
        _check_share("data.picture_share", self.picture_share)
        _check_share("data.border_share", self.border_share)
        _check_share("data.drift_share", self.drift_share)
        if not 0 <= self.drift_scale < 0.5:
            raise ContractError(f"data.drift_scale must be in [0, 0.5); got {self.drift_scale}")
        if not 0 < self.iso_min <= self.iso_max:
            raise ContractError(f"data.iso_min must be in (0, iso_max]; got {self.iso_min}")
        if self.exposure_min_ev > self.exposure_max_ev:
            raise ContractError("data.exposure_min_ev must not exceed exposure_max_ev")
        if not 0 < self.first_samples < self.pool_samples:
            raise ContractError("data.first_samples must lie between 0 and pool_samples")
        if min(self.sample_px, self.scene_px, self.procedural_scenes, self.steps_per_sample) < 1:
            raise ContractError("sizes and counts of data must be positive")
        if any(not 0 < share < math.inf for share in self.depth_shares):
            raise ContractError(
                f"data.depth_shares must be positive and finite; got {self.depth_shares}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduleRecipe:
    """How the network is fitted.

    Attributes:
        steps: Steps of the whole schedule; `--max-minutes` may end it sooner, decay included.
        batch: Patches per step.
        patch_px: Side of a training patch.
        learning_rate: Peak of AdamW's rate: linear warm-up, then a half cosine.
        final_rate: Rate at the end, relative to the peak.
        warmup_steps: Steps of warm-up.
        weight_decay: AdamW's decay.
        gradient_clip: Largest norm of the gradient.
        ema_decay: Decay of the weight average that is validated and exported.
        loss: log_mse or mse, both in the square-root domain of the signal.
        precision: bfloat16 multiplies (weights stay float32) or float32.
        float32_share: Share of the schedule, at its end, computed in float32 anyway.
        seed: Seed of weights, samples and order.
    """

    steps: int = 40_000
    batch: int = 8
    patch_px: int = 128
    learning_rate: float = 2e-3
    final_rate: float = 0.005
    warmup_steps: int = 200
    weight_decay: float = 1e-4
    gradient_clip: float = 1.0
    ema_decay: float = 0.999
    loss: str = "log_mse"
    precision: str = "bfloat16"
    float32_share: float = 0.05
    seed: int = 1

    def __post_init__(self) -> None:
        if self.loss not in LOSSES:
            raise ContractError(f"schedule.loss must be one of {LOSSES}; got {self.loss!r}")
        if self.precision not in PRECISIONS:
            raise ContractError(
                f"schedule.precision must be one of {PRECISIONS}; got {self.precision!r}"
            )
        _check_share("schedule.float32_share", self.float32_share)
        _check_share("schedule.ema_decay", self.ema_decay)
        if min(self.steps, self.batch, self.patch_px) < 1 or self.learning_rate <= 0:
            raise ContractError("schedule needs positive steps, batch, patch_px, learning_rate")


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkRecipe:
    """One size of network.

    Attributes:
        network: Name in the catalogue of networks.
        config: Fields of its config that differ from the defaults.
        schedule: The schedule, with what this network changes of it.
    """

    network: str
    config: Mapping[str, Any] = field(default_factory=dict)
    schedule: ScheduleRecipe = field(default_factory=ScheduleRecipe)


FINE_TUNING_SCHEDULE: Final = ScheduleRecipe(
    steps=20_000, batch=4, patch_px=256, learning_rate=1e-4, final_rate=0.0, precision="float32"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FineTuningRecipe:
    """Fine-tuning: a trained network against two discriminators (Sun 2021, section 6.2.2).

    Attributes:
        schedule: Of the fine-tuning.
        perceptual_weight: nu1 of eq. (6.12), on the features.
        pixel_weight: nu2, on the pixels. The thesis prints 0.5 and 0.006 for the two; these
            defaults are the order of the source it cites (Kupyn et al. 2019).
        global_weight: sigma_g of eq. (6.14), on the global discriminator.
        local_weight: sigma_l, on the local one.
        global_layers: Strided layers of the global discriminator.
        local_layers: Of the local one.
        discriminator_width: Channels of their first layer.
        discriminator_rate: Learning rate of both, with the decay of the schedule.
        pair_share: Share of a batch drawn from real pairs, where there are any.
        pair_samples: Samples cut from each real pair.
    """

    schedule: ScheduleRecipe = FINE_TUNING_SCHEDULE
    perceptual_weight: float = 0.006
    pixel_weight: float = 0.5
    global_weight: float = 0.01
    local_weight: float = 0.01
    global_layers: int = 5
    local_layers: int = 3
    discriminator_width: int = 64
    discriminator_rate: float = 1e-4
    pair_share: float = 0.5
    pair_samples: int = 32

    def __post_init__(self) -> None:
        weights = self.perceptual_weight, self.pixel_weight, self.global_weight, self.local_weight
        if min(weights) < 0 or self.pixel_weight + self.perceptual_weight == 0:
            raise ContractError(
                "fine_tuning needs weights >= 0, and one of perceptual and pixel > 0"
            )
        counts = self.global_layers, self.local_layers, self.discriminator_width, self.pair_samples
        if min(counts) < 1 or self.discriminator_rate <= 0:
            raise ContractError(
                "fine_tuning needs layers, width, pair_samples, discriminator_rate > 0"
            )
        _check_share("fine_tuning.pair_share", self.pair_share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A camera and how its networks are trained.

    Attributes:
        name: Name of the camera and its bundle.
        object_distance_mm: Distance the lens is focused on; inf is allowed.
        scale: Divisor of the stabilised planes, see the manifest.
        wiener: Prior and blocks of the Wiener bank in front of the networks.
    """

    name: str
    object_distance_mm: float
    scale: float
    camera: Camera
    wiener: Wiener
    lens: LensRecipe
    data: DataRecipe
    networks: Mapping[str, NetworkRecipe]
    fine_tuning: FineTuningRecipe = field(default_factory=FineTuningRecipe)

    def __post_init__(self) -> None:
        shares, depths = len(self.data.depth_shares), len(self.lens.depths_mm)
        if shares and shares != depths:
            raise ContractError(f"data.depth_shares has {shares} entries, lens.depths_mm {depths}")
        if self.data.known_depth_share and depths < 2:
            raise ContractError("data.known_depth_share needs two or more lens.depths_mm")

    def network(self, size: str) -> NetworkRecipe:
        """Give the network of a size, or raise ContractError naming the sizes there are."""
        if size not in self.networks:
            raise ContractError(
                f"recipe {self.name} has the sizes {', '.join(self.networks)}; got {size!r}"
            )
        return self.networks[size]


def read_recipe(path: Path) -> Recipe:
    """Read and check a recipe.

    Raises:
        ContractError: If the file is missing, is no TOML, or a key is unknown, missing or wrong.
    """
    return to_recipe(read_table(path, "recipe"))


def to_recipe(table: Mapping[str, Any]) -> Recipe:
    """Turn a parsed TOML table into a recipe; raises ContractError as `read_recipe` does."""
    table = _renamed(table)
    known = {"name", "object_distance_mm", "scale", "camera", "wiener", "lens"}
    check_keys("recipe", table, known | {"data", "schedule", "networks", "fine_tuning"})
    schedule = section("schedule", ScheduleRecipe, table.get("schedule", {}))
    networks = table.get("networks")
    if not isinstance(networks, Mapping) or not networks:
        raise ContractError("a recipe needs at least one table [networks.SIZE]")
    return Recipe(
        name=typed("name", table.get("name"), str),
        object_distance_mm=typed("object_distance_mm", table.get("object_distance_mm"), float),
        scale=typed("scale", table.get("scale", 64.0), float),
        camera=_model("camera", Camera, table),
        wiener=_model("wiener", Wiener, table),
        lens=section("lens", LensRecipe, table.get("lens", {})),
        data=section("data", DataRecipe, table.get("data", {})),
        networks={size: _network(size, entry, schedule) for size, entry in networks.items()},
        fine_tuning=_fine_tuning(table.get("fine_tuning", {})),
    )


def _renamed(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Give the table of today's names: what is `fine_tuning` was `final` in older recipes.

    Checkpoints carry their recipe as text, so the older name is read for ever.
    """
    if "final" not in table:
        return table
    if "fine_tuning" in table:
        raise ContractError("final is the older name of fine_tuning; a recipe holds one of them")
    others = {key: value for key, value in table.items() if key != "final"}
    return others | {"fine_tuning": table["final"]}


def _network(size: str, entry: Mapping[str, Any], schedule: ScheduleRecipe) -> NetworkRecipe:
    where = f"networks.{size}"
    check_keys(where, entry, {"network", "config", "schedule"})
    changed = asdict(schedule) | dict(entry.get("schedule", {}))
    return NetworkRecipe(
        network=typed(f"{where}.network", entry.get("network"), str),
        config=dict(entry.get("config", {})),
        schedule=section(f"{where}.schedule", ScheduleRecipe, changed),
    )


def _fine_tuning(table: Any) -> FineTuningRecipe:
    if not isinstance(table, Mapping):
        raise ContractError(f"fine_tuning must be a table; got {table!r}")
    changed = asdict(FINE_TUNING_SCHEDULE) | dict(table.get("schedule", {}))
    schedule = section("fine_tuning.schedule", ScheduleRecipe, changed)
    return section("fine_tuning", FineTuningRecipe, {**table, "schedule": schedule})


def differing_camera(one: Recipe, other: Recipe) -> str | None:
    """Name the first part by which two recipes describe different cameras, None if none does.

    How networks are trained, and on which samples, may differ from size to size.
    """
    parts = ("name", "object_distance_mm", "scale", "camera", "wiener", "lens")
    return next((part for part in parts if getattr(one, part) != getattr(other, part)), None)


def samples_digest(recipe: Recipe, seed: int) -> str:
    """Give a hash of all that decides the training samples, to name their pool by."""
    content = {
        "camera": recipe.camera.model_dump(mode="json"),
        "wiener": recipe.wiener.model_dump(mode="json"),
        "lens": recipe.lens.to_json(),
        "data": asdict(recipe.data),
        "scale": recipe.scale,
        "object_distance_mm": str(recipe.object_distance_mm),
        "seed": seed,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _model(where: str, kind: type[M], table: Mapping[str, Any]) -> M:
    """Check a table that is part of the manifest too."""
    try:
        return kind.model_validate(table.get(where, {}))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join([where, *(str(part) for part in first["loc"])])
        raise ContractError(f"{place}: {first['msg']}") from error

"""Recipes of single-photon cameras: an array, how it samples, and how many photons it is given."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages import Sharpen
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.sampling import MODES
from camkit.models_def.networks.bicubic import SCALE
from camkit.models_def.toml_table import section, table_digest
from camkit.models_def.training.recipe import DataRecipe, Recipe, common_tables, model

ROLES: Final = ("upscale",)
PLATE: Final = "plate"
"""Role of a network that is trained with its plate; no bundle holds it."""
OWN_KEYS: Final = ("sampling", "times")
CAMERA_PARTS: Final = ("name", "sensor", "sampling", "times")
"""What says which camera it is; how its networks are trained may differ."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingRecipe:
    """The sampling by the array, see `sampling`.

    Attributes:
        mode: low_fill, full_fill, gaussian or learned.
        psf: Of `learned`: PSF file, or the checkpoint the plate was trained in, relative to the
            recipe.
        sigma: Of `gaussian`, in sub-pixels; without it that of the thesis.
    """

    mode: str = "learned"
    psf: str | None = None
    sigma: float | None = None

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ContractError(
                f"sampling.mode must be one of {', '.join(MODES)}; got {self.mode!r}"
            )
        if (self.psf is not None) != (self.mode == "learned"):
            raise ContractError(
                f"sampling.psf belongs to the mode learned, and to it alone; got {self.mode}"
            )
        if self.sigma is not None and self.mode != "gaussian":
            raise ContractError(f"sampling.sigma belongs to the mode gaussian; got {self.mode}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpadDataRecipe(DataRecipe):
    """The settings of training samples.

    `sample_px` and the schedule's `patch_px` count pixels of the array; of the role plate, whose
    samples are pictures, sub-pixels.

    Attributes:
        photons_min: Fewest photons of a pixel that sees white, drawn log-uniformly.
        photons_max: Most.
        detected: Share of photons that are counted.
        dark_counts: Of a pixel, without light.
        told: Whether networks are given the noise of every pixel as a second plane.
    """

    sample_px: int = 64
    photons_min: float = 30.0
    photons_max: float = 1e6
    detected: float = 1.0
    dark_counts: float = 0.0
    told: bool = True

    def __post_init__(self) -> None:
        DataRecipe.__post_init__(self)
        if not 0 < self.photons_min <= self.photons_max:
            raise ContractError(
                f"data.photons_min must be in (0, photons_max]; got {self.photons_min}"
            )
        self.exposure(self.photons_min)

    def exposure(self, photons: float) -> Exposure:
        """Return the exposure of so many photons of white."""
        return Exposure(photons=photons, detected=self.detected, dark_counts=self.dark_counts)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpadRecipe(Recipe):
    """A single-photon camera and how its networks are trained.

    Attributes:
        sensor: The array.
        data: How samples are made.
        sampling: How the array samples.
        times: Gate and pulse that a bundle takes captures to have which state none.
    """

    sensor: SpadSensor
    data: SpadDataRecipe
    sampling: SamplingRecipe = field(default_factory=SamplingRecipe)
    times: Sharpen = field(default_factory=Sharpen)


def to_spad_recipe(table: Mapping[str, Any]) -> SpadRecipe:
    """Convert a parsed TOML table to a recipe.

    Raises:
        ContractError: If a key is unknown, missing or wrong, or the sensor counts no photons.
    """
    common = common_tables(table, kind_keys=OWN_KEYS, roles=(*ROLES, PLATE), main=ROLES[0])
    if not isinstance(common.sensor, SpadSensor):
        raise ContractError(
            f'this kind of camera counts photons; sensor.type must be "spad", got '
            f'"{common.sensor.type}"'
        )
    if common.sensor.sub_pixels != SCALE:
        raise ContractError(
            f"pictures are made {SCALE} times as fine as the array; sensor.sub_pixels must be "
            f"{SCALE}, got {common.sensor.sub_pixels}"
        )
    return SpadRecipe(
        name=common.name,
        kind=common.kind,
        sensor=common.sensor,
        networks=common.networks,
        sampling=section("sampling", SamplingRecipe, table.get("sampling", {})),
        times=model("times", Sharpen, table),
        data=section("data", SpadDataRecipe, table.get("data", {})),
    )


def samples_digest(recipe: SpadRecipe, role: str, seed: int) -> str:
    """Return a hash of all that decides the training samples, to name their pool by."""
    content = {
        "sampling": asdict(recipe.sampling),
        "phase": recipe.sensor.phase,
        "data": asdict(recipe.data),
        "role": role,
        "seed": seed,
    }
    return table_digest(content)

"""Recipes of cameras for photographs: a lens, its light, a Wiener bank, and fine-tuning.

The sensor has a mosaic, or gives planes: three colours, as developed pictures have, or grey.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, field, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.light_bound import LightBound
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import Dehaze, Together, Wiener
from camkit.bundle.stages.network import DEFAULT_ROLE
from camkit.calibration.measured import WAVELENGTHS_UM
from camkit.calibration.psf_import.own_colours import narrow_response
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.scene_light import DisplayRecipe, WildRecipe
from camkit.models_def.optics.analysis.psf_model import checked_regime
from camkit.models_def.toml_table import Faults, section, table_digest, typed
from camkit.models_def.training.pictures import DrawnShares
from camkit.models_def.training.recipe import (
    DataRecipe,
    Recipe,
    ScheduleRecipe,
    check_share,
    common_tables,
    model,
    own_schedule,
    picture_sensor,
    with_new_names,
)

ROLES: Final = (DEFAULT_ROLE,)
OWN_KEYS: Final = (
    *("object_distance_mm", "scale", "light", "haze", "wiener", "lens", "frames"),
    "fine_tuning",
)
CAMERA_PARTS: Final = (
    *("name", "object_distance_mm", "scale", "sensor", "light", "haze", "wiener", "lens"),
)
"""What says which camera it is; how its networks are trained may differ."""
WAVELENGTHS: Final = 27
"""Traced by default: so many that lateral colour leaves no steps."""
MEASURED_COLOURS: Final = "one measured kernel for each colour"
_OLDER: Final = {"final": "fine_tuning"}


@dataclass(frozen=True, slots=True, kw_only=True)
class LensRecipe:
    """The lens, or its measured PSF, and the variation of its copies.

    Attributes:
        prescription: Name of a built-in lens, or path of a file (.toml, .zmx) relative to the
            recipe.
        psf: In place of it: path of a measured PSF (.safetensors, of `camkit psf import`) relative
            to the recipe. `fields`, `kernel_px` and `rays` are those of the file then.
        psf_model: Of a lens: "rays", "waves", or empty for waves where its spot is that sharp; see
            `camkit.models_def.optics.analysis.psf_model`.
        uncertainty: Of a measured PSF: noise, shift in pixels and width of
            `camkit.psf.PsfUncertainty`; empty for that of the file.
        copies: Fabricated copies whose PSFs are trained on.
        validation_copies: Further ones that pictures to choose by are taken with, in turn. One
            alone may be an outlier; eight show what the lens is like.
        fields: Field heights of the kernel bank.
        kernel_px: Side of its kernels, odd.
        rays: Rays in half the pupil.
        wavelengths: Of the sensor's band that are traced; between two of them lateral colour should
            move light by less than a pixel.
        seed: Seed of the fabrication errors.
        depths_mm: Object distances, increasing, with the sensor where the prescription has it; a
            sample is taken at one of them by chance, the Wiener filter has their mean kernel.
            Empty for the distance of the prescription. Of a lens with a haze every copy is used at
            one of them, in turn.
        bank_in_focus: Whether the Wiener filter has the kernel of the prescription's distance,
            whatever `depths_mm` are, in place of their mean.
    """

    prescription: str = ""
    psf: str = ""
    copies: int = 8
    fields: int = 25
    kernel_px: int = 129
    rays: int = 4096
    wavelengths: int = WAVELENGTHS
    seed: int = 101
    depths_mm: tuple[float, ...] = ()
    validation_copies: int = 1
    bank_in_focus: bool = False
    uncertainty: tuple[float, ...] = ()
    psf_model: str = ""

    def __post_init__(self) -> None:
        checked_regime(self.psf_model, "lens.psf_model")
        if self.psf and self.psf_model:
            raise ContractError("lens.psf_model needs a lens; a measured PSF is as it is")
        if bool(self.prescription) == bool(self.psf):
            raise ContractError(
                'lens needs prescription = "..." (a lens) or psf = "..." (a measured PSF), one of '
                "them"
            )
        if self.uncertainty and (len(self.uncertainty) != 3 or not self.psf):
            raise ContractError(
                "lens.uncertainty is [noise, shift_px, width] of a measured PSF; got "
                f"{list(self.uncertainty)}"
            )
        if self.psf and self.bank_in_focus:
            raise ContractError("lens.bank_in_focus needs a lens; a measured PSF has its depths")
        if min(self.fields, self.wavelengths) < 2:
            raise ContractError(
                "lens.fields and lens.wavelengths must be >= 2; got "
                f"{self.fields}, {self.wavelengths}"
            )
        if min(self.copies, self.validation_copies) < 1:
            raise ContractError(
                "lens.copies and lens.validation_copies must be >= 1; got "
                f"{self.copies}, {self.validation_copies}"
            )
        if any(near >= far for near, far in pairwise((0.0, *self.depths_mm))):
            raise ContractError(f"lens.depths_mm must increase from above 0; got {self.depths_mm}")

    def distance_of(self, copy: int) -> float | None:
        """Return the distance at which a copy of a lens with a haze is used; None for its own.

        Copies to choose by, which come last, begin at the first distance again.
        """
        turn = copy if copy < self.copies else copy - self.copies
        return self.depths_mm[turn % len(self.depths_mm)] if self.depths_mm else None

    def to_json(self) -> dict[str, Any]:
        """Return the values that decide the kernels, to name files by, without defaults."""
        usual = {"depths_mm": (), "validation_copies": 1, "bank_in_focus": False}
        usual |= {"psf": "", "uncertainty": (), "wavelengths": WAVELENGTHS, "psf_model": ""}
        return {name: value for name, value in asdict(self).items() if value != usual.get(name)}


@dataclass(frozen=True, slots=True, kw_only=True)
class BayerDataRecipe(DataRecipe):
    """The settings of training samples.

    Attributes:
        margin_px: Simulated surroundings of a sample that the Wiener filter sees.
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
        edge_share: Share of samples of clean edges, which photographs have few of.
        night_share: Share of samples of stars and discs on black.
        patch_share: Share of samples of charts in any colour, deep primaries too.
        lamp_share: Share of all samples into which lamps far beyond white are put.
        designed_share: Share of samples through the lens as designed, of several depths only where
            a filter is told its depth (`known_depth_share`, or a bank that estimates it).
        light_share: Share of samples in light of any colour, by any white balance from 1, 1, 1 up:
            raw values of the colours then stand in any ratio.
        known_depth_share: Share of samples whose Wiener filter has the kernel of their depth, as
            `camkit process --depth-m` gives it; the others' has the mean kernel. Left out where
            the bank estimates the depth: then all have it.
        depth_error: Standard deviation of the depth that a filter is told, in 1/m.
        display: A display that shows the scenes; None for none.
        wild: Daylight and range of scenes; None for pictures as they are.
    """

    margin_px: int = 72
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
    depth_error: float = 0.0
    edge_share: float = 0.0
    night_share: float = 0.0
    patch_share: float = 0.0
    lamp_share: float = 0.0
    designed_share: float = 0.0
    light_share: float = 0.0
    display: DisplayRecipe | None = None
    wild: WildRecipe | None = None

    def __post_init__(self) -> None:
        DataRecipe.__post_init__(self)
        clean = ("edge_share", "night_share", "patch_share")
        for name in clean:
            check_share(f"data.{name}", getattr(self, name))
        sum_name = " + ".join(f"data.{name}" for name in clean)
        check_share(sum_name, sum(getattr(self, name) for name in clean))
        check_share("data.light_share", self.light_share)
        check_share("data.designed_share", self.designed_share)
        check_share("data.lamp_share", self.lamp_share)
        check_share("data.known_depth_share", self.known_depth_share)
        if self.depth_error < 0:
            raise ContractError(f"data.depth_error must be >= 0; got {self.depth_error:g}")
        check_share("data.border_share", self.border_share)
        check_share("data.drift_share", self.drift_share)
        if not 0 <= self.drift_scale < 0.5:
            raise ContractError(f"data.drift_scale must be in [0, 0.5); got {self.drift_scale}")
        if not 0 < self.iso_min <= self.iso_max:
            raise ContractError(f"data.iso_min must be in (0, iso_max]; got {self.iso_min}")
        if self.exposure_min_ev > self.exposure_max_ev:
            raise ContractError("data.exposure_min_ev must not exceed exposure_max_ev")
        if any(not 0 < share < math.inf for share in self.depth_shares):
            raise ContractError(
                f"data.depth_shares must be positive and finite; got {self.depth_shares}"
            )
        if self.display is not None and self.wild is not None:
            raise ContractError("scenes are shown by data.display or lit by data.wild, not both")

    def to_json(self) -> dict[str, Any]:
        """Return the values that decide samples, to name files by, without unused ones."""
        later = ("display", "wild", "patch_share", "designed_share", "light_share")
        absent = {name for name in later if not getattr(self, name)}
        return {name: value for name, value in asdict(self).items() if name not in absent}

    @property
    def drawn_shares(self) -> DrawnShares:
        """Shares of drawn scenes whose truth is known to the last pixel."""
        return DrawnShares(
            edge=self.edge_share,
            night=self.night_share,
            patch=self.patch_share,
            lamp=self.lamp_share,
        )

    def lit(self, rng: np.random.Generator, scene: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the light of a (3, h, w) scene, and its target.

        Draws only where a recipe asks for it: others keep their samples.
        """
        if self.display is not None:
            return self.display.shown_light(scene)
        light = scene if self.wild is None else self.wild.lit(rng, scene)
        return light, light


@dataclass(frozen=True, slots=True, kw_only=True)
class FramesRecipe:
    """The settings of whole frames, which tiles are cut from.

    A frame is a scene of the whole sensor, put together from crops of pictures and drawn scenes;
    every shot of it has an ISO of its own.

    Attributes:
        count: Frames to train on.
        validation_count: Frames of other pictures and other copies of the lens, to choose by.
        crop_px: Side of the crops.
        shots: Of every frame.
        tiles: Cut from every shot.
        validation_tiles: Likewise, to choose by.
    """

    count: int = 16
    validation_count: int = 2
    crop_px: int = 1000
    shots: int = 2
    tiles: int = 80
    validation_tiles: int = 30

    def __post_init__(self) -> None:
        if min(astuple(self)) < 1:
            raise ContractError(f"sizes and counts of frames must be positive; got {self}")


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
        check_share("fine_tuning.pair_share", self.pair_share)


@dataclass(frozen=True, slots=True, kw_only=True)
class BayerRecipe(Recipe):
    """A camera for photographs and how its networks are trained.

    Attributes:
        sensor: With a mosaic or with planes, a size and the response of its colours.
        data: How samples are made.
        object_distance_mm: Distance the lens is focused on; inf is allowed.
        scale: Divisor of the stabilised planes, see the manifest.
        wiener: Prior and blocks of the Wiener bank in front of the networks.
        lens: The lens, and how far its copies vary.
        fine_tuning: Later training.
        light: How far networks may move the light of the bank; None for as far as they like.
        haze: How the haze of the lens is undone before the bank; None for a lens without.
        frames: Of a lens with a haze, whose samples are cut from whole frames.
    """

    sensor: ColorSensor
    data: BayerDataRecipe
    object_distance_mm: float
    scale: float
    wiener: Wiener
    lens: LensRecipe
    fine_tuning: FineTuningRecipe = field(default_factory=FineTuningRecipe)
    light: LightBound | None = None
    haze: Dehaze | None = None
    frames: FramesRecipe = field(default_factory=FramesRecipe)

    def __post_init__(self) -> None:
        if self.sensor.cfa is None and (self.haze is not None or self.wiener.mosaic is not None):
            raise ContractError(
                "a sensor of planes has no mosaic, which [haze] and wiener.mosaic need; leave them "
                "out"
            )
        if self.haze is not None and self.wiener.mosaic is not None:
            raise ContractError(
                "the tiles of a lens with a haze do not tell where their mosaic begins; leave "
                "wiener.mosaic out"
            )
        if self.haze is not None and self.lens.psf:
            raise ContractError("a haze needs a lens; leave [haze] out, or name a prescription")
        if self.haze is not None and self.lens.depths_mm:
            self._check_hazy_depths()
        shares, depths = len(self.data.depth_shares), len(self.lens.depths_mm)
        if shares and shares != depths:
            raise ContractError(f"data.depth_shares has {shares} entries, lens.depths_mm {depths}")
        if self.data.designed_share and depths > 1 and not self.tells_depth:
            raise ContractError(
                "data.designed_share needs the kernels of each of lens.depths_mm; set "
                "data.known_depth_share or wiener.depth too"
            )
        if self.data.known_depth_share and self.estimates_depth:
            raise ContractError(
                "where wiener.depth is estimated every filter is told a depth; leave "
                "data.known_depth_share out"
            )
        if self.tells_depth and depths < 2:
            raise ContractError(
                "data.known_depth_share and a wiener.depth that is estimated need two or more "
                "lens.depths_mm"
            )
        if self.data.depth_error and not self.tells_depth:
            raise ContractError("data.depth_error is for filters that are told a depth")

    @property
    def estimates_depth(self) -> bool:
        """Return whether the bank of the camera finds the distance of the scene in the capture."""
        return self.wiener.depth == "estimated"

    @property
    def tells_depth(self) -> bool:
        """Return whether the filters of some samples have the kernels of one depth."""
        return self.estimates_depth or self.data.known_depth_share > 0

    def _check_hazy_depths(self) -> None:
        if not self.lens.bank_in_focus:
            raise ContractError(
                "the bank of a lens with veiling glare has the distance of the prescription alone; "
                "state lens.bank_in_focus = true, or leave depths_mm out"
            )
        least = len(self.lens.depths_mm)
        if min(self.lens.copies, self.frames.count) < least:
            raise ContractError(
                "a frame of a lens with a haze sees one distance, through one copy; lens.copies "
                f"and frames.count must be {least} at least, got {self.lens.copies} and "
                f"{self.frames.count}"
            )
        if self.data.depth_shares or self.tells_depth:
            raise ContractError(
                "frames of a lens with a haze see its distances in turn; leave data.depth_shares, "
                "data.known_depth_share and a wiener.depth that is estimated out"
            )

    def with_together(self, together: Together | None) -> "BayerRecipe":
        """Return it with another model of colours in its bank, None for each alone."""
        if together is None:
            return replace(self, wiener=self.wiener.alone())
        return replace(self, wiener=self.wiener.model_copy(update={"together": together}))


def to_bayer_recipe(table: Mapping[str, Any]) -> BayerRecipe:
    """Convert a parsed TOML table to a recipe.

    Raises:
        ContractError: If keys are unknown, missing or wrong, all of which are named, the sensor is
            of another kind, or there are frames without a haze.
    """
    table = _with_measured_response(with_new_names(table, _OLDER))
    faults = Faults()
    common = faults.read(common_tables, table, kind_keys=OWN_KEYS, roles=ROLES)
    faults.read(_check_frames, table)
    faults.read(_check_pattern, table)
    distance_mm = faults.read(typed, "object_distance_mm", table.get("object_distance_mm"), float)
    parts = {
        "scale": faults.read(typed, "scale", table.get("scale", 64.0), float),
        "wiener": faults.read(model, "wiener", Wiener, table),
        "lens": faults.read(section, "lens", LensRecipe, table.get("lens", {})),
        "data": faults.read(_data, table.get("data", {})),
        "fine_tuning": faults.read(_fine_tuning, table.get("fine_tuning", {})),
        "light": faults.read(model, "light", LightBound, table) if "light" in table else None,
        "haze": faults.read(model, "haze", Dehaze, table) if "haze" in table else None,
        "frames": faults.read(section, "frames", FramesRecipe, table.get("frames", {})),
    }
    faults.refuse()
    return BayerRecipe(
        name=common.name,
        kind=common.kind,
        sensor=picture_sensor(common.sensor),
        networks=common.networks,
        object_distance_mm=distance_mm,
        **parts,
    )


def _check_pattern(table: Mapping[str, Any]) -> None:
    sensor = table.get("sensor")
    if isinstance(sensor, Mapping) and not {"cfa", "type"} & sensor.keys():
        raise ContractError(
            'sensor.cfa is missing; a sensor without a mosaic states type = "planes"'
        )


def _check_frames(table: Mapping[str, Any]) -> None:
    if "frames" in table and "haze" not in table:
        raise ContractError("[frames] is for a lens with a haze; there is no table [haze]")


def _with_measured_response(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Fill in the response of a sensor whose own colours the kernels of a recipe are."""
    sensor, lens = table.get("sensor"), table.get("lens")
    if not (isinstance(sensor, Mapping) and isinstance(lens, Mapping) and lens.get("psf")):
        return table
    if "channel_response" in sensor:
        return table
    waves, rows = (array.tolist() for array in narrow_response(np.array(WAVELENGTHS_UM)))
    response = {"wavelengths_um": waves, "response": rows, "source": MEASURED_COLOURS}
    return {**table, "sensor": {**sensor, "channel_response": response}}


def _data(table: Any) -> BayerDataRecipe:
    if not isinstance(table, Mapping):
        raise ContractError(f"data must be a table; got {table!r}")
    kinds = {"display": DisplayRecipe, "wild": WildRecipe}
    sections: dict[str, Any] = {
        k: section(f"data.{k}", kinds[k], table[k]) for k in kinds if k in table
    }
    return section("data", BayerDataRecipe, {**table, **sections})


def _fine_tuning(table: Any) -> FineTuningRecipe:
    if not isinstance(table, Mapping):
        raise ContractError(f"fine_tuning must be a table; got {table!r}")
    schedule = own_schedule("fine_tuning.schedule", table.get("schedule", {}), FINE_TUNING_SCHEDULE)
    return section("fine_tuning", FineTuningRecipe, {**table, "schedule": schedule})


def samples_digest(recipe: BayerRecipe, seed: int) -> str:
    """Return a hash of all that decides the training samples, to name their pool by."""
    content = {
        "sensor": recipe.sensor.model_dump(mode="json"),
        "wiener": recipe.wiener.model_dump(mode="json"),
        "lens": recipe.lens.to_json(),
        "data": recipe.data.to_json(),
        "scale": recipe.scale,
        "object_distance_mm": str(recipe.object_distance_mm),
        "seed": seed,
    }
    if recipe.light is not None:
        content["kept"] = True
    if recipe.haze is not None:
        content |= {"haze": recipe.haze.model_dump(mode="json"), "frames": asdict(recipe.frames)}
    return table_digest(content)

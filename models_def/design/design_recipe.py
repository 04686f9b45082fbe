"""A joint design as TOML: which lens, what of it is free, what it looks at, what recovers it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, get_args

from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.design.expected import Descent
from camkit.models_def.design.front import Front
from camkit.models_def.design.lens_module import MoveUnits
from camkit.models_def.design.loop import DesignSchedule
from camkit.models_def.design.loss import DesignLoss
from camkit.models_def.design.shipped_camera import CameraChoice
from camkit.models_def.design.starts import Starts
from camkit.models_def.networks.catalog import NETWORK_NAMES
from camkit.models_def.optics.analysis.psf_model import checked_regime
from camkit.models_def.optics.search.joint_states import JointVariable
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.variables import Variable
from camkit.models_def.optics.shape.phase import Phase, parse_monomials
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors
from camkit.models_def.toml_table import check_keys, faults_of, section, table_digest, typed
from camkit.models_def.training.recipe import SceneRecipe
from camkit.side_file import read_side_toml

T = TypeVar("T")
Spacing = Literal["height", "area"]

_KEYS: Final = {
    *("name", "prescription", "vary", "optics", "limits", "pixels", "front", "network", "loss"),
    *("schedule", "data", "starts", "fabrication", "camera", "descent", "phase"),
}

_LATER_KEYS: Final = (("optics", "psf_model"), ("optics", "azimuths_deg"), ("starts", "depth_mm"))


@dataclass(frozen=True, slots=True, kw_only=True)
class OpticsRecipe:
    """The fields, wavelengths and depths at which the lens is sampled.

    Attributes:
        half_field_deg: Field angle of the far end of the strip.
        fields: How many fields from the axis.
        spacing: Of the fields: equal steps of ideal image height, or of its square, so that every
            field stands for an equal area of the image circle.
        object_distances_mm: Depths; empty for that of the lens.
        focus_distance_mm: The depth that the sensor is focused on; 0 for the first one.
        efl_mm: Kept by the curvature of `solved_surface`; 0 keeps nothing.
        solved_surface: See there.
        rides: Whether the sensor rides on the paraxial image.
        pupil_rays: In half the pupil.
        whiten: Whether one unit of every move changes the spots alike.
        units: Without whitening a move of 1 is the whole `range` of a number or 1 in its `own`
            unit (1/mm, mm, 1 for a conic), which is what the rates of the thesis are in.
        f_number: Of the lens; 0 for that of the prescription.
        configurations: Names of the states of the lens that count, or "all"; empty for one state.
            Fields are then those of the first, and the same image heights of the others.
        azimuths_deg: Of the images of the fields, from +y towards +x: each but the axis is looked
            at from all of them, by rays through the whole pupil, as a lens that is not round
            needs. Empty for +y alone.
        psf_model: "rays", "waves", or empty for waves where the lens at the start is that sharp;
            see `camkit.models_def.optics.analysis.psf_model`.
    """

    half_field_deg: float
    fields: int = 9
    spacing: Spacing = "height"
    object_distances_mm: tuple[float, ...] = ()
    focus_distance_mm: float = 0.0
    efl_mm: float = 0.0
    solved_surface: int = -1
    rides: bool = True
    pupil_rays: int = 512
    whiten: bool = True
    units: MoveUnits = "range"
    f_number: float = 0.0
    configurations: tuple[str, ...] = ()
    azimuths_deg: tuple[float, ...] = ()
    psf_model: str = ""

    def __post_init__(self) -> None:
        if not 0 < self.half_field_deg < 80 or self.fields < 2 or self.pupil_rays < 1:
            raise ContractError(
                "optics needs half_field_deg in 0..80, fields >= 2 and pupil_rays >= 1"
            )
        if self.spacing not in get_args(Spacing):
            raise ContractError(
                f"spacing must be one of {', '.join(get_args(Spacing))}; got {self.spacing!r}"
            )
        if self.focus_distance_mm and self.focus_distance_mm not in self.object_distances_mm:
            raise ContractError(
                f"focus_distance_mm must be one of object_distances_mm "
                f"{list(self.object_distances_mm)} (or 0); got {self.focus_distance_mm}"
            )
        if checked_regime(self.psf_model, "optics.psf_model") == "waves" and self.azimuths_deg:
            raise UnsupportedError("waves are summed along +y: leave out azimuths_deg or psf_model")
        alone = ("rides", "efl_mm", "object_distances_mm", "f_number")
        if self.configurations and any(names := [n for n in alone if getattr(self, n)]):
            raise ContractError(
                f"optics.configurations takes focal lengths, distances and apertures of the lens, "
                f"and a sensor at rest: leave {', '.join(names)} out, with rides = false"
            )
        if self.whiten and self.units != "range":
            raise ContractError("whitened moves have no units: set whiten = false or leave units")


@dataclass(frozen=True, slots=True, kw_only=True)
class PhaseRecipe:
    """A phase plate or diffractive surface that the lens at the start has besides.

    Attributes:
        surface: That it lies on.
        radius_mm: To which r, x and y are normalised.
        radial_rad: Coefficients of (r / radius)^2, (r / radius)^4, ...
        free_rad: Coefficients by the name of a term in x and y, such as x3.
        order: Of diffraction.
    """

    surface: int
    radius_mm: float
    radial_rad: tuple[float, ...] = ()
    free_rad: Mapping[str, float] = field(default_factory=dict)
    order: float = 1.0

    def __post_init__(self) -> None:
        if not self.phase.coefficients:
            raise ContractError("a [[phase]] needs radial_rad or free_rad")

    @property
    def phase(self) -> Phase:
        """The phase of the surface."""
        return Phase(
            radius_mm=self.radius_mm,
            radial_rad=self.radial_rad,
            free_rad=parse_monomials(self.free_rad),
            order=self.order,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PixelRecipe:
    """The sensor of a design.

    Attributes:
        pitch_um: Of the pixels.
        kernel_px: Odd window of a PSF; 0 takes what the lens at the start needs.
        wavelengths_um: Increasing, an odd number.
        color_weights: One row of weights for R, G and B, as many as wavelengths.
        noise: Standard deviation, 1.0 = white level.
        cfa: RGGB or another order of the colour filters; empty for three colours in each pixel.
    """

    pitch_um: float
    kernel_px: int = 65
    wavelengths_um: tuple[float, ...] = (0.46, 0.54, 0.61)
    color_weights: tuple[tuple[float, ...], ...] = (
        (0.02, 0.13, 0.85),
        (0.08, 0.84, 0.08),
        (0.85, 0.14, 0.01),
    )
    noise: float = 0.01
    cfa: str = ""

    def __post_init__(self) -> None:
        rows = {len(row) for row in self.color_weights}
        if len(self.color_weights) != 3 or rows != {len(self.wavelengths_um)}:
            raise ContractError(
                "color_weights must be three rows (R, G, B) of one weight per wavelength"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkChoice:
    """The choice of a network; the empty name stands for none.

    Attributes:
        name: In the catalogue.
        config: What of its config differs from the defaults.
        start: First weights: a bundle, the name of a built-in one, or a checkpoint; empty for
            weights drawn by chance.
        start_size: The network of a bundle with several.
    """

    name: str = ""
    config: dict[str, Any]
    start: str = ""
    start_size: str = "S"

    def __post_init__(self) -> None:
        if self.name and self.name not in NETWORK_NAMES:
            raise ContractError(
                f"network must be one of {', '.join(NETWORK_NAMES)}; got {self.name!r}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignRecipe:
    """A joint design.

    Attributes:
        name: Of the camera.
        prescription: Name of a built-in prescription or path of a lens file.
        variables: What of the lens is free.
        state_variables: Gaps that are free in one configuration each.
        phases: That the lens at the start has besides.
        starts: How many lenses near it are tried first.
        fabrication: Errors of the copies that captures are made with; None for the lens itself.
        camera: Whose bank stands in front, where `front` restores colours together.
        descent: On what that bank is expected to leave, from the best start; None for none.
    """

    name: str
    prescription: str
    variables: tuple[Variable, ...]
    optics: OpticsRecipe
    limits: Limits
    pixels: PixelRecipe
    front: Front
    network: NetworkChoice
    loss: DesignLoss
    schedule: DesignSchedule
    data: SceneRecipe
    starts: Starts
    fabrication: FabricationErrors | None = None
    camera: CameraChoice | None = None
    descent: Descent | None = None
    state_variables: tuple[JointVariable, ...] = ()
    phases: tuple[PhaseRecipe, ...] = ()


def read_design(path: Path) -> DesignRecipe:
    """Read and check a design recipe.

    Raises:
        ContractError: If the file is missing, is no TOML, or a key is unknown, missing or wrong.
    """
    table = read_side_toml(path, "design recipe")
    with faults_of(f"design recipe {path}"):
        return to_design(table)


def to_design(table: Mapping[str, Any]) -> DesignRecipe:
    """Convert a parsed TOML table to a recipe; raises ContractError as `read_design` does."""
    check_keys("design recipe", table, _KEYS)
    for key in ("name", "prescription", "vary", "optics", "pixels"):
        if key not in table:
            raise ContractError(f"design recipe lacks {key}")
    free, phases = table["vary"], table.get("phase", [])
    if not isinstance(free, list):
        raise ContractError("what varies must be written as [[vary]] tables")
    if not isinstance(phases, list):
        raise ContractError("added phases must be written as [[phase]] tables")
    variables = [_variable(f"vary[{i}]", one) for i, one in enumerate(free)]
    network = {"config": {}, **dict(table.get("network", {}))}
    recipe = DesignRecipe(
        name=typed("name", table["name"], str),
        prescription=typed("prescription", table["prescription"], str),
        variables=tuple(v.variable for v in variables if not v.state),
        state_variables=tuple(v for v in variables if v.state),
        phases=tuple(section(f"phase[{i}]", PhaseRecipe, p) for i, p in enumerate(phases)),
        optics=section("optics", OpticsRecipe, table["optics"]),
        limits=section("limits", Limits, table.get("limits", {})),
        pixels=section("pixels", PixelRecipe, table["pixels"]),
        front=section("front", Front, table.get("front", {})),
        network=section("network", NetworkChoice, network),
        loss=section("loss", DesignLoss, table.get("loss", {})),
        schedule=section("schedule", DesignSchedule, table.get("schedule", {})),
        data=section("data", SceneRecipe, table.get("data", {})),
        starts=section("starts", Starts, table.get("starts", {})),
        fabrication=_optional("fabrication", FabricationErrors, table),
        camera=_optional("camera", CameraChoice, table),
        descent=_optional("descent", Descent, table),
    )
    if (recipe.camera is not None) != (recipe.front.kind == "together"):
        raise ContractError("the front 'together' and a table [camera] belong together")
    if recipe.descent is not None and (recipe.camera is None or recipe.fabrication is None):
        raise ContractError("a table [descent] needs [camera] and [fabrication]")
    _check_states(recipe)
    if recipe.starts.judged and not recipe.pixels.kernel_px:
        raise ContractError("judged starts need one window for all: set pixels.kernel_px")
    if recipe.starts.judged and recipe.loss.needs_network and recipe.front.kind == "none":
        raise ContractError("judged starts need a front that recovers: set front.kind")
    return recipe


def _variable(where: str, table: Any) -> JointVariable:
    """Read a free number, and the configuration that it is of, if any."""
    if not isinstance(table, Mapping) or "configuration" not in table:
        return JointVariable(variable=section(where, Variable, table))
    state = typed(f"{where}.configuration", table["configuration"], str)
    rest = {key: value for key, value in table.items() if key != "configuration"}
    return JointVariable(variable=section(where, Variable, rest), state=state)


def _check_states(recipe: DesignRecipe) -> None:
    """Refuse what does not go with several configurations, or without."""
    if not recipe.optics.configurations:
        if recipe.state_variables:
            raise ContractError("vary.configuration needs optics.configurations")
        return
    if recipe.starts.searches or recipe.starts.library or recipe.descent is not None:
        raise ContractError("several configurations begin at the lens: leave starts, descent out")
    if recipe.phases or recipe.optics.azimuths_deg:
        raise UnsupportedError("several configurations take no [[phase]] and no azimuths_deg yet")
    if not recipe.front.depth_known:
        raise ContractError("several configurations are known to the filter: set depth_known")


def _optional(name: str, kind: type[T], table: Mapping[str, Any]) -> T | None:
    return section(name, kind, table[name]) if name in table else None


def with_choices(
    recipe: DesignRecipe,
    *,
    steps: int | None = None,
    lens_rate: float | None = None,
    prescription: str | None = None,
    seed: int | None = None,
    search: bool = True,
    library: bool | None = None,
) -> DesignRecipe:
    """Return the recipe with a caller's choices; None keeps the value of the recipe.

    Without `search` the design begins at the prescription itself; `library` says whether a search
    begins at the built-in lenses too.

    Raises:
        ContractError: If the library is to be searched without a search.
    """
    if library and not search:
        raise ContractError(
            f"{option_text('library')} is a search, and {option_text('search')} is off"
        )
    changes = {"steps": steps, "lens_rate": lens_rate, "seed": seed}
    overrides = {key: value for key, value in changes.items() if value is not None}
    schedule = replace(recipe.schedule, **overrides)  # type: ignore[arg-type]
    starts = recipe.starts if library is None else replace(recipe.starts, library=library)
    return replace(
        recipe,
        schedule=schedule,
        prescription=prescription or recipe.prescription,
        starts=starts if search else Starts(),
        descent=recipe.descent if search else None,
    )


def recipe_digest(recipe: DesignRecipe) -> str:
    """Return a hash of all that decides a run."""
    table = {name: value for name, value in asdict(recipe).items() if value is not None}
    for part, key in _LATER_KEYS:  # designs from before there were waves, plates, ... can go on
        if not table[part][key]:
            del table[part][key]
    if not recipe.phases:
        del table["phases"]
    if recipe.limits.max_steepness == Limits().max_steepness:  # it could not be chosen
        del table["limits"]["max_steepness"]
    if not recipe.optics.configurations:  # nor configurations
        del table["optics"]["configurations"], table["state_variables"]
    if not recipe.network.start:  # nor first weights
        for key in ("start", "start_size"):
            del table["network"][key]
    if not recipe.starts.library:  # nor was there a library
        for key in ("library", "library_lenses", "elements"):
            del table["starts"][key]
    return table_digest(table)

"""A joint design as TOML: which lens, what of it is free, what it looks at, what recovers it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, get_args

from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.design.design_schedule import DesignSchedule
from camkit.models_def.design.expected import Descent
from camkit.models_def.design.front import Front
from camkit.models_def.design.lens_module import MoveUnits
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
from camkit.models_def.toml_table import (
    check_keys,
    check_least,
    faults_of,
    section,
    table_digest,
    typed,
)
from camkit.models_def.training.recipe import SceneRecipe
from camkit.side_file import read_side_toml

T = TypeVar("T")
Spacing = Literal["height", "area"]

_LATER_KEYS: Final = (("optics", "psf_model"), ("optics", "azimuths_deg"), ("starts", "depth_mm"))


@dataclass(frozen=True, slots=True, kw_only=True)
class OpticsRecipe:
    """The fields and depths at which the lens is sampled, and what its sensor and power follow.

    With `configurations`, distances, apertures and focal lengths come from the lens file:
    `object_distances_mm`, `f_number`, `efl_mm` and `rides = true` are refused.

    Attributes:
        half_field_deg: Field angle at the end of the strip of fields; more than 0, less than 80.
        fields: Number of fields, the axis included; at least 2.
        spacing: Steps between fields. `height`: equal steps of ideal image height. `area`: equal
            steps of its square, so that every field stands for an equal area of the image circle.
        object_distances_mm: Depths that count; empty for the distance of the lens file.
        focus_distance_mm: Depth that the sensor is focused on; 0 for the first one.
        efl_mm: Focal length that the curvature of `solved_surface` keeps; 0 keeps none.
        solved_surface: Surface whose curvature keeps `efl_mm`, from 0; -1 is the last one. Its
            curvature is not free.
        rides: The sensor follows the paraxial image. If false, free the last gap.
        pupil_rays: Number of rays in half the pupil; at least 1.
        whiten: One unit of every move changes the RMS spot by one pixel, so that one
            `lens_rate` serves all numbers.
        units: Unit of a move where `whiten` is false. `range`: the whole range of a number.
            `own`: 1 in the unit of its kind, as in the thesis.
        f_number: F-number of the lens; 0 for the aperture of the lens file.
        configurations: Names of the states of the lens that count, or `["all"]`; empty for one
            state. The fields are those of the first state; the others see the same image heights.
        azimuths_deg: Directions of the fields from +y towards +x, traced through the whole pupil,
            as a lens that is not round needs. Empty for +y alone.
        psf_model: Model of the PSF; empty for waves where the blur of the lens at the start is
            below 7 Airy radii, else rays. A step by waves may take 50 times as long: begin with
            `rays`. `azimuths_deg` takes no waves.
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
        if not 0 < self.half_field_deg < 80:
            raise ContractError(
                f"half_field_deg must be > 0 and < 80 degrees; got {self.half_field_deg}"
            )
        check_least(self, 2, "fields")
        check_least(self, 1, "pupil_rays")
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
    """A phase plate or diffractive surface that is added to the lens at the start.

    It needs `radial_rad` or `free_rad`. Its coefficients become free by `[[vary]]` of kind
    `phase`, counted in this order: radial ones first.

    Attributes:
        surface: Surface that it lies on, from 0.
        radius_mm: Radius that r, x and y are divided by.
        radial_rad: Coefficients of r^2, r^4, r^6, ...
        free_rad: Coefficients by the name of a term in x and y, such as
            `{ x3 = 200.0, y3 = 200.0 }`; the lens is then not round.
        order: Diffraction order; all light goes into it.
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
        pitch_um: Pixel pitch.
        kernel_px: Side of the window of a PSF, odd; 0 takes what holds 99 % of the light of the
            lens at the start, and a quarter more.
        wavelengths_um: Wavelengths that are traced: an odd number of them, increasing.
        color_weights: Three rows (R, G, B) of one weight per wavelength.
        noise: Standard deviation of the noise; 1.0 = white level.
        cfa: Order of the colour filters, such as `RGGB`; empty for three colours in every pixel.
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
        if not self.pitch_um > 0:
            raise ContractError(f"pitch_um must be > 0; got {self.pitch_um}")
        rows = {len(row) for row in self.color_weights}
        if len(self.color_weights) != 3 or rows != {len(self.wavelengths_um)}:
            raise ContractError(
                "color_weights must be three rows (R, G, B) of one weight per wavelength"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkChoice:
    """The network behind the front end.

    Attributes:
        name: Network of the catalogue; empty for none: the front end alone recovers.
        config: Settings of the network that differ from its defaults.
        start: First weights: a bundle, a built-in name or a checkpoint; empty for random ones.
        start_size: Size of the network of that bundle.
    """

    name: str = ""
    config: dict[str, Any] = field(default_factory=dict)
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
        name: Name of the camera; the files of the run bear it.
        prescription: Lens at the start: a built-in name, or a lens file beside the recipe.
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


TABLES: Final[Mapping[str, type]] = {
    "vary": Variable,
    "phase": PhaseRecipe,
    "optics": OpticsRecipe,
    "limits": Limits,
    "pixels": PixelRecipe,
    "front": Front,
    "network": NetworkChoice,
    "loss": DesignLoss,
    "schedule": DesignSchedule,
    "data": SceneRecipe,
    "starts": Starts,
    "fabrication": FabricationErrors,
    "camera": CameraChoice,
    "descent": Descent,
}
"""Classes that read the tables of a recipe; docs/reference/recipes.md lists their keys."""
REPEATED: Final = frozenset({"vary", "phase"})
"""Tables that are written once for each number or phase."""
REQUIRED: Final = ("name", "prescription", "vary", "optics", "pixels")
STATE_KEY: Final = "configuration"
"""Of [[vary]]: the state that a gap is of."""


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
    check_keys("design recipe", table, {"name", "prescription", *TABLES})
    for key in REQUIRED:
        if key not in table:
            raise ContractError(f"design recipe lacks {key}")
    free, phases = table["vary"], table.get("phase", [])
    if not isinstance(free, list):
        raise ContractError("what varies must be written as [[vary]] tables")
    if not isinstance(phases, list):
        raise ContractError("added phases must be written as [[phase]] tables")
    variables = [_variable(f"vary[{i}]", one) for i, one in enumerate(free)]
    recipe = DesignRecipe(
        name=typed("name", table["name"], str),
        prescription=typed("prescription", table["prescription"], str),
        variables=tuple(v.variable for v in variables if not v.state),
        state_variables=tuple(v for v in variables if v.state),
        phases=tuple(_table(f"phase[{i}]", PhaseRecipe, p) for i, p in enumerate(phases)),
        optics=_table("optics", OpticsRecipe, table["optics"]),
        limits=_table("limits", Limits, table.get("limits", {})),
        pixels=_table("pixels", PixelRecipe, table["pixels"]),
        front=_table("front", Front, table.get("front", {})),
        network=_table("network", NetworkChoice, table.get("network", {})),
        loss=_table("loss", DesignLoss, table.get("loss", {})),
        schedule=_table("schedule", DesignSchedule, table.get("schedule", {})),
        data=_table("data", SceneRecipe, table.get("data", {})),
        starts=_table("starts", Starts, table.get("starts", {})),
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
    if isinstance(table, Mapping):
        check_keys(where, table, {STATE_KEY, *(one.name for one in fields(Variable))})
    if not isinstance(table, Mapping) or STATE_KEY not in table:
        return JointVariable(variable=_table(where, Variable, table))
    state = typed(f"{where}.{STATE_KEY}", table[STATE_KEY], str)
    rest = {key: value for key, value in table.items() if key != STATE_KEY}
    return JointVariable(variable=_table(where, Variable, rest), state=state)


def _table(where: str, kind: type[T], table: Any) -> T:
    """Read a table; a message that begins with one of its keys names the table too."""
    try:
        return section(where, kind, table)
    except ContractError as error:
        if str(error).split(" ")[0] in {one.name for one in fields(kind)}:  # type: ignore[arg-type]
            raise ContractError(f"{where}.{error}") from error
        raise


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
    return _table(name, kind, table[name]) if name in table else None


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

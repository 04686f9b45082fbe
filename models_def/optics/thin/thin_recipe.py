"""The recipe of a thin plate, for `camkit lens thin`."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.toml_table import check_keys, faults_of, section, typed
from camkit.side_file import read_side_toml
from camkit.units import to_radians

RECIPES: Final = Path(__file__).resolve().parents[2] / "recipes"
LEAST_MM: Final = 1e-2
MOST_MM: Final = 1000.0
"""Lengths of a plate."""
Faces = Literal["both", "front", "back"]


def _at_least(what: str, value: float, least: float, *, open_: bool = True) -> None:
    fine = value > least if open_ else value >= least
    if not (fine and math.isfinite(value)):
        raise ContractError(f"{what} must be {'>' if open_ else '>='} {least:g}; got {value!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateTable:
    """The plate.

    Attributes:
        glass: Strict name.
        faces: Which carry a profile.
        thickness_mm: Of the plate.
        efl_mm: Focal length, kept.
        aperture_mm: Clear diameter of the front face.
        terms: Of each profile: r^2, r^4, ...
        groove_pi: Phase of a groove in units of pi at the wavelength.
        wavelength_um: For which the plate is solved.
        tool_radius_um: See `grooves.Grooves`; 0 leaves sharp feet.
    """

    glass: str
    faces: Faces
    thickness_mm: float
    efl_mm: float
    aperture_mm: float
    terms: int = 6
    groove_pi: float = 200.0
    wavelength_um: float = 0.55
    tool_radius_um: float = 0.0

    def __post_init__(self) -> None:
        for name in ("groove_pi", "wavelength_um"):
            _at_least(f"plate.{name}", getattr(self, name), 0)
        for name in ("thickness_mm", "efl_mm", "aperture_mm"):
            length_mm = getattr(self, name)
            if not LEAST_MM <= length_mm <= MOST_MM:
                raise ContractError(
                    f"plate.{name} must be {LEAST_MM:g} to {MOST_MM:g} mm; got {length_mm!r}"
                )
        if self.index <= 1:
            raise ContractError(f"plate.glass must bend light; got {self.glass}")
        _at_least("plate.tool_radius_um", self.tool_radius_um, 0, open_=False)
        if not 1 <= self.terms <= 12:
            raise ContractError(f"plate.terms must be 1..12; got {self.terms}")

    @property
    def index(self) -> float:
        """Index of the glass at the wavelength."""
        wave = torch.tensor([self.wavelength_um], dtype=torch.float64)
        return float(refractive_index(find_glass(self.glass), wave))

    @property
    def groove_depth_um(self) -> float:
        """Height of glass that delays the light by the phase of a groove."""
        return self.groove_pi / 2 * self.wavelength_um / (self.index - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartitionTable:
    """The virtual apertures.

    Attributes:
        corner_deg: Field angle of the sensor's corner.
        directions: From the axis to the corner, in equal steps.
        radius_mm: Of each virtual aperture.
        weights: What each direction counts; all alike if empty.
    """

    corner_deg: float
    radius_mm: float
    directions: int = 7
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not LEAST_MM <= self.radius_mm <= MOST_MM:
            raise ContractError(
                f"partition.radius_mm must be {LEAST_MM:g} to {MOST_MM:g} mm; got "
                f"{self.radius_mm!r}"
            )
        if not 0 < self.corner_deg < 80:
            raise ContractError(f"partition.corner_deg must lie in 0..80; got {self.corner_deg}")
        if not 2 <= self.directions <= 50:
            raise ContractError(f"partition.directions must be 2..50; got {self.directions}")
        if self.weights and len(self.weights) != self.directions:
            raise ContractError(
                f"partition.weights needs {self.directions} numbers, one for each direction; "
                f"got {len(self.weights)}"
            )
        for weight in self.weights:
            _at_least("partition.weights", weight, 0)

    @property
    def field_angles_rad(self) -> tuple[float, ...]:
        """Field angles, (direction,)."""
        last = self.directions - 1
        return tuple(to_radians(self.corner_deg * i / last) for i in range(self.directions))


@dataclass(frozen=True, slots=True, kw_only=True)
class StopTable:
    """A real stop in front of the finished plate.

    Attributes:
        diameter_mm: Of its hole; 0 for none, and the front face is the stop.
        distance_mm: In front of the plate.
    """

    diameter_mm: float = 0.0
    distance_mm: float = 0.0

    def __post_init__(self) -> None:
        _at_least("stop.diameter_mm", self.diameter_mm, 0, open_=False)
        _at_least("stop.distance_mm", self.distance_mm, 0, open_=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class SolverTable:
    """The settings of the solver.

    Attributes:
        steps: Of damped least squares.
        rays: In half of each virtual aperture.
    """

    steps: int = 150
    rays: int = 40

    def __post_init__(self) -> None:
        for name in ("steps", "rays"):
            if not 1 <= getattr(self, name) <= 10_000:
                raise ContractError(f"solver.{name} must be 1..10000; got {getattr(self, name)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ThinRecipe:
    """A plate, its virtual apertures, its stop, how it is solved."""

    name: str
    note: str
    plate: PlateTable
    partition: PartitionTable
    stop: StopTable = field(default_factory=StopTable)
    solver: SolverTable = field(default_factory=SolverTable)

    def __post_init__(self) -> None:
        room_mm = self.plate.aperture_mm / 2 - self.partition.radius_mm
        if room_mm < 0:
            raise ContractError(
                f"a virtual aperture of radius {self.partition.radius_mm:g} mm does not fit into "
                f"plate.aperture_mm = {self.plate.aperture_mm:g}"
            )


def find_thin_recipe(path: Path) -> ThinRecipe:
    """Read a recipe by its path, or that of camkit with this name.

    Raises:
        ContractError: As `read_thin_recipe`, or if neither is there.
    """
    if path.is_file() or path.name != str(path) or path.suffix:
        return read_thin_recipe(path)
    packaged = RECIPES / f"{path}.toml"
    if not packaged.is_file():
        names = sorted(file.stem for file in RECIPES.glob("thin_*_lens.toml"))
        raise ContractError(f"no recipe is called {path}; there are {', '.join(names)}, or a file")
    return read_thin_recipe(packaged)


def read_thin_recipe(path: Path) -> ThinRecipe:
    """Read a recipe.

    Raises:
        ContractError: If a key is unknown, missing or of a wrong type, or a value is refused.
    """
    table = read_side_toml(path, "recipe")
    with faults_of(f"recipe {path}"):
        check_keys("recipe", table, {"name", "note", "plate", "partition", "stop", "solver"})
        missing = [key for key in ("name", "plate", "partition") if key not in table]
        if missing:
            raise ContractError(f"recipe lacks {', '.join(missing)}")
        return ThinRecipe(
            name=typed("name", table["name"], str),
            note=typed("note", table.get("note", ""), str),
            plate=section("plate", PlateTable, table["plate"]),
            partition=section("partition", PartitionTable, table["partition"]),
            stop=section("stop", StopTable, table.get("stop", {})),
            solver=section("solver", SolverTable, table.get("solver", {})),
        )

"""A design of a plate as TOML: bench, map, goal, pixels, etching, how it runs, who reads it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal, get_args

from camkit.errors import ContractError
from camkit.models_def.design.plate.goal import Goal
from camkit.models_def.design.plate.reader_recipe import ReaderRecipe
from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.toml_table import check_keys, faults_of, section, table_digest, typed
from camkit.side_file import read_side_toml

MapKind = Literal["full", "rank", "gratings", "zernike", "radial"]
_TABLES: Final = ("bench", "map", "goal", "pixels", "etching", "schedule", "reader")
_KEYS: Final = {"name", "glass", "cells", *_TABLES}


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRecipe:
    """The free numbers of a map, and their start.

    Attributes:
        kind: full (every cell), rank, gratings, zernike or radial.
        begin: A plate, by file or name, to begin at; empty for random numbers.
        start: Their standard deviation: of v and q, or of heights in um.
        rank: Columns of v and q.
        most_um: h_max of a map of rank.
        offset: Added to the first column of v and q; without it and with a small `start` a map
            of rank begins on a saddle.
        angles_deg: Of the gratings.
        numbers: Samples of a grating or a radial profile, terms of Zernike.
    """

    kind: MapKind
    begin: str = ""
    start: float = 0.3
    rank: int = 3
    most_um: float = 1.125
    offset: float = 0.0
    angles_deg: tuple[float, ...] = ()
    numbers: int = 0

    def __post_init__(self) -> None:
        """Refuse a map without what its kind needs.

        Raises:
            ContractError: If so.
        """
        if self.begin:
            return
        if self.kind == "gratings" and not self.angles_deg:
            raise ContractError("map: gratings need angles_deg, or a plate to begin at")
        if self.kind in {"gratings", "zernike", "radial"} and self.numbers < 2:
            raise ContractError(f"map: {self.kind} needs numbers >= 2; got {self.numbers}")
        if not self.start >= 0:
            raise ContractError(f"map: start must be >= 0; got {self.start}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlatePixels:
    """The pixels on which light is judged.

    Attributes:
        pitch_um: Of the pixels.
        side_px: Odd side of the window.
        wavelengths_um: One for each colour.
        samples: Per pixel and axis; 0 for as many as light can vary. Masks are many pixels wide:
            half as many do.
    """

    pitch_um: float = 5.97
    side_px: int = 257
    wavelengths_um: tuple[float, ...] = (0.46, 0.54, 0.61)
    samples: int = 3

    def __post_init__(self) -> None:
        """Refuse values that are no pixels.

        Raises:
            ContractError: If so.
        """
        if not self.wavelengths_um or not min(self.wavelengths_um) > 0 or self.samples < 0:
            raise ContractError(
                f"pixels need wavelengths_um > 0 and samples >= 0; got "
                f"{list(self.wavelengths_um)}, {self.samples}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateSchedule:
    """The schedule of a design.

    Attributes:
        steps: In all.
        rate: Of Adam, falling to 0 in proportion to the steps left.
        log_steps: Steps between what is logged and kept.
        etched: Design through the levels of [etching], gradients passing straight through.
        depth_error: Standard deviation of the share by which a mask etches too deep, drawn anew
            every step; needs `etched`.
        seed: Of the start and the errors.
    """

    steps: int = 200
    rate: float = 0.02
    log_steps: int = 10
    etched: bool = False
    depth_error: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        """Refuse a schedule that does not run.

        Raises:
            ContractError: If so.
        """
        if min(self.steps, self.log_steps) < 1 or not self.rate > 0:
            raise ContractError(
                f"schedule needs steps and log_steps >= 1 and rate > 0; got {self.steps}, "
                f"{self.log_steps}, {self.rate}"
            )
        if not self.depth_error >= 0 or (self.depth_error and not self.etched):
            raise ContractError("depth_error must be >= 0, and needs etched = true")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateRecipe:
    """A design of a plate; with a `reader` a network is fitted along."""

    name: str
    glass: str
    cells: int
    bench: Bench
    map: MapRecipe
    goal: Goal
    pixels: PlatePixels
    schedule: PlateSchedule
    etching: Etching | None = None
    reader: ReaderRecipe | None = None


def read_plate_recipe(path: Path) -> PlateRecipe:
    """Read and check a recipe.

    Raises:
        ContractError: If the file is missing, is no TOML, or a key is unknown, missing or wrong.
    """
    table = read_side_toml(path, "plate recipe")
    with faults_of(f"plate recipe {path}"):
        return to_plate_recipe(table)


def to_plate_recipe(table: Mapping[str, Any]) -> PlateRecipe:
    """Convert a parsed TOML table to a recipe; raises ContractError as `read_plate_recipe` does."""
    check_keys("plate recipe", table, _KEYS)
    for key in ("name", "cells", "bench", "map"):
        if key not in table:
            raise ContractError(f"plate recipe lacks {key}")
    recipe = PlateRecipe(
        name=typed("name", table["name"], str),
        glass=typed("glass", table.get("glass", "SILICA"), str),
        cells=typed("cells", table["cells"], int),
        bench=section("bench", Bench, table["bench"]),
        map=section("map", MapRecipe, table["map"]),
        goal=section("goal", Goal, table.get("goal", {})),
        pixels=section("pixels", PlatePixels, table.get("pixels", {})),
        schedule=section("schedule", PlateSchedule, table.get("schedule", {})),
        etching=section("etching", Etching, table["etching"]) if "etching" in table else None,
        reader=section("reader", ReaderRecipe, table["reader"]) if "reader" in table else None,
    )
    if recipe.schedule.etched and recipe.etching is None:
        raise ContractError("schedule.etched needs a table [etching]")
    if recipe.map.kind not in get_args(MapKind):
        raise ContractError(f"map.kind must be one of {', '.join(get_args(MapKind))}")
    return recipe


def with_plate_choices(
    recipe: PlateRecipe, *, steps: int | None = None, seed: int | None = None
) -> PlateRecipe:
    """Return the recipe with a caller's choices; None keeps the value of the recipe."""
    changes = {"steps": steps, "seed": seed}
    overrides = {key: value for key, value in changes.items() if value is not None}
    return replace(recipe, schedule=replace(recipe.schedule, **overrides))  # type: ignore[arg-type]


def plate_recipe_digest(recipe: PlateRecipe) -> str:
    """Return a hash of all that decides a run."""
    table = asdict(recipe)
    if recipe.reader is None:  # as before there were readers
        del table["reader"]
    return table_digest(table)

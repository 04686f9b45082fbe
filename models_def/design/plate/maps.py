"""The free numbers that a design of a plate begins at: random ones, or those of another plate."""

import math
from pathlib import Path
from typing import Final

import torch

from camkit.errors import ContractError
from camkit.models_def.design.plate.plate_recipe import MapKind, PlateRecipe
from camkit.models_def.optics.diffraction.heights import (
    FullMap,
    GratingMap,
    RadialMap,
    RankMap,
    ZernikeMap,
)
from camkit.models_def.optics.diffraction.map_numbers import HeightMap, map_of
from camkit.models_def.optics.diffraction.patterns import CrossPattern, StarPattern
from camkit.models_def.optics.diffraction.plate import Plate, read_plate

_KINDS: Final[dict[MapKind, type[HeightMap]]] = {
    "full": FullMap,
    "rank": RankMap,
    "gratings": GratingMap,
    "zernike": ZernikeMap,
    "radial": RadialMap,
}


def begin_map(recipe: PlateRecipe, folder: Path | None = None) -> HeightMap:
    """Return the map that a design begins at.

    Args:
        recipe: Its map says where.
        folder: For a relative path of the plate to begin at.

    Raises:
        ContractError: If that plate cannot be read, has other cells or no such map, or the random
            map is none.
    """
    if recipe.map.begin:
        return _map_of_plate(recipe, folder)
    generator = torch.Generator().manual_seed(recipe.schedule.seed)
    chosen, cells = recipe.map, recipe.cells
    if chosen.kind == "rank":
        return RankMap(
            cells,
            rank=chosen.rank,
            most_um=chosen.most_um,
            offset=chosen.offset,
            start=chosen.start,
            seed=recipe.schedule.seed,
        )
    if chosen.kind == "full":
        return FullMap(chosen.start * torch.randn(cells, cells, generator=generator))
    if chosen.kind == "gratings":
        angles_rad = tuple(math.radians(angle) for angle in chosen.angles_deg)
        profiles = torch.randn(len(angles_rad), chosen.numbers, generator=generator)
        return GratingMap(cells, angles_rad, chosen.start * profiles)
    numbers_um = chosen.start * torch.randn(chosen.numbers, generator=generator)
    return (
        ZernikeMap(cells, numbers_um) if chosen.kind == "zernike" else RadialMap(cells, numbers_um)
    )


def _map_of_plate(recipe: PlateRecipe, folder: Path | None) -> HeightMap:
    given = Path(recipe.map.begin)
    beside = given if folder is None else folder / given
    plate = read_plate(beside if beside.is_file() else given)
    if plate.height_um.shape[0] != recipe.cells:
        raise ContractError(
            f"{recipe.map.begin} has {plate.height_um.shape[0]} cells along a side, the recipe "
            f"{recipe.cells}"
        )
    if recipe.map.kind == "full":
        return FullMap(plate.height_um)
    found = _own_map(plate)
    if not isinstance(found, _KINDS[recipe.map.kind]):
        raise ContractError(
            f"{recipe.map.begin} has no map of the kind {recipe.map.kind} to begin at; "
            "kind = full takes any plate"
        )
    return found


def _own_map(plate: Plate) -> HeightMap | None:
    """Return the map by which a plate is made, if it has few numbers."""
    if plate.numbers is not None:
        return map_of(plate.numbers)
    if isinstance(plate.pattern, CrossPattern):
        return plate.pattern.rank_map(plate.bench, plate.index, plate.height_um.shape[0])
    if isinstance(plate.pattern, StarPattern):
        return plate.pattern.grating_map(plate.bench, plate.index, plate.height_um.shape[0])
    return None

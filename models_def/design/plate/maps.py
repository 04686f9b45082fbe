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
    choice, cells = recipe.map, recipe.cells
    if choice.kind == "rank":
        return RankMap(
            cells,
            rank=choice.rank,
            most_um=choice.most_um,
            offset=choice.offset,
            start=choice.start,
            seed=recipe.schedule.seed,
        )
    if choice.kind == "full":
        return FullMap(choice.start * torch.randn(cells, cells, generator=generator))
    if choice.kind == "gratings":
        angles_rad = tuple(math.radians(angle) for angle in choice.angles_deg)
        profiles = torch.randn(len(angles_rad), choice.numbers, generator=generator)
        return GratingMap(cells, angles_rad, choice.start * profiles)
    numbers_um = choice.start * torch.randn(choice.numbers, generator=generator)
    return (
        ZernikeMap(cells, numbers_um) if choice.kind == "zernike" else RadialMap(cells, numbers_um)
    )


def _map_of_plate(recipe: PlateRecipe, folder: Path | None) -> HeightMap:
    begin = Path(recipe.map.begin)
    path = begin if folder is None else folder / begin
    plate = read_plate(path if path.is_file() else begin)
    if plate.height_um.shape[0] != recipe.cells:
        raise ContractError(
            f"{recipe.map.begin} has {plate.height_um.shape[0]} cells along a side, the recipe "
            f"{recipe.cells}"
        )
    if recipe.map.kind == "full":
        return FullMap(plate.height_um)
    height_map = _own_map(plate)
    if not isinstance(height_map, _KINDS[recipe.map.kind]):
        raise ContractError(
            f"{recipe.map.begin} has no map of the kind {recipe.map.kind} to begin at; "
            "kind = full takes any plate"
        )
    return height_map


def _own_map(plate: Plate) -> HeightMap | None:
    """Return the map by which a plate is made, if it has few numbers."""
    if plate.numbers is not None:
        return map_of(plate.numbers)
    if isinstance(plate.pattern, CrossPattern):
        return plate.pattern.rank_map(plate.bench, plate.index, plate.height_um.shape[0])
    if isinstance(plate.pattern, StarPattern):
        return plate.pattern.grating_map(plate.bench, plate.index, plate.height_um.shape[0])
    return None

"""Designs begin at random numbers that follow from the seed, or at another plate's."""

from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.plate.maps import begin_map
from camkit.models_def.design.plate.plate_recipe import PlateRecipe, to_plate_recipe
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.heights import (
    FullMap,
    GratingMap,
    RadialMap,
    RankMap,
    ZernikeMap,
)
from camkit.models_def.optics.diffraction.map_numbers import HeightMap, numbers_of
from camkit.models_def.optics.diffraction.patterns import (
    CrossPattern,
    FlatPattern,
    Pattern,
    StarPattern,
)
from camkit.models_def.optics.diffraction.plate import Plate, pattern_plate, write_plate
from tests.models_def.design.plate.test_plate_recipe import table

BENCH = Bench(diameter_mm=2.0, focal_length_mm=25.0, focus_mm=2000.0)
STREAK = {"near_um": 30.0, "far_um": 120.0, "share": 0.06}


def _recipe(**of_map: Any) -> PlateRecipe:
    return to_plate_recipe(table(map=of_map))


@pytest.mark.parametrize(
    ("of_map", "kind"),
    [
        ({"kind": "full", "start": 0.1}, FullMap),
        ({"kind": "rank"}, RankMap),
        ({"kind": "gratings", "angles_deg": [0, 30], "numbers": 50}, GratingMap),
        ({"kind": "zernike", "numbers": 10}, ZernikeMap),
        ({"kind": "radial", "numbers": 20}, RadialMap),
    ],
)
def test_random_maps_follow_from_the_seed(of_map: dict[str, Any], kind: type[HeightMap]) -> None:
    recipe = _recipe(**of_map)
    made = begin_map(recipe)
    assert type(made) is kind
    assert made().shape == (96, 96)
    assert torch.equal(made(), begin_map(recipe)())
    other = to_plate_recipe(table(map=of_map, schedule={"seed": 2}))
    assert not torch.equal(made(), begin_map(other)())


@pytest.mark.parametrize(
    ("pattern", "kind"),
    [
        (StarPattern(angles_deg=(0.0, 45.0), **STREAK), "gratings"),
        (CrossPattern(**STREAK), "rank"),
        (FlatPattern(), "full"),
        (CrossPattern(**STREAK), "full"),
    ],
)
def test_a_design_begins_at_the_heights_of_a_plate(
    pattern: Pattern, kind: str, tmp_path: Path
) -> None:
    plate = pattern_plate("begin", pattern, cells=96, bench=BENCH)
    write_plate(plate, tmp_path / "begin.toml")
    made = begin_map(_recipe(kind=kind, begin="begin.toml"), tmp_path)
    torch.testing.assert_close(made().float(), plate.height_um, atol=1e-6, rtol=0)


def test_a_design_goes_on_with_the_numbers_of_another(tmp_path: Path) -> None:
    zernike = ZernikeMap(96, torch.linspace(0, 0.1, 6))
    plate = Plate(
        name="z",
        glass="SILICA",
        bench=BENCH,
        height_um=zernike().detach(),
        numbers=numbers_of(zernike),
    )
    write_plate(plate, tmp_path / "z.toml")
    made = begin_map(_recipe(kind="zernike", begin=str(tmp_path / "z.toml")))
    assert torch.equal(made(), zernike())
    with pytest.raises(ContractError, match="no map of the kind radial to begin at; kind = full"):
        begin_map(_recipe(kind="radial", begin="z.toml"), tmp_path)


def test_a_plate_of_other_cells_or_of_no_numbers_is_refused(tmp_path: Path) -> None:
    write_plate(pattern_plate("flat", FlatPattern(), cells=64, bench=BENCH), tmp_path / "flat.toml")
    with pytest.raises(ContractError, match="has 64 cells along a side, the recipe 96"):
        begin_map(_recipe(kind="full", begin="flat.toml"), tmp_path)
    write_plate(pattern_plate("same", FlatPattern(), cells=96, bench=BENCH), tmp_path / "same.toml")
    with pytest.raises(ContractError, match="no map of the kind rank"):
        begin_map(_recipe(kind="rank", begin="same.toml"), tmp_path)

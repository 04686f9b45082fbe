"""The numbers of a height map as tensors of a file, and the heights that follow from them.

    height_um                  (cells, cells)          every cell
    v, q, most_um              (cells, rank), (1,)     RankMap
    angles_rad, profiles_um    (line,), (line, n)      GratingMap
    coefficients_um            (term,)                 ZernikeMap
    profile_um                 (n,)                    RadialMap

All but the first hold `cells` (1,), int64, besides. A map of rank 3 takes 36 kB where its heights
take 9 MB.
"""

from collections.abc import Mapping
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.heights import (
    FullMap,
    GratingMap,
    RadialMap,
    RankMap,
    ZernikeMap,
)

HEIGHTS: Final = "height_um"
MAX_CELLS: Final = 16_384
HeightMap = FullMap | RankMap | GratingMap | ZernikeMap | RadialMap
_KINDS: Final[dict[frozenset[str], type[HeightMap]]] = {
    frozenset({HEIGHTS}): FullMap,
    frozenset({"v", "q", "most_um", "cells"}): RankMap,
    frozenset({"angles_rad", "profiles_um", "cells"}): GratingMap,
    frozenset({"coefficients_um", "cells"}): ZernikeMap,
    frozenset({"profile_um", "cells"}): RadialMap,
}
_AXES: Final = {HEIGHTS: 2, "v": 2, "q": 2, "profiles_um": 2}


def numbers_of(height_map: HeightMap) -> dict[str, Tensor]:
    """Return the numbers of a map, float32."""
    numbers = {name: value.detach().float() for name, value in height_map.named_parameters()}
    if isinstance(height_map, FullMap):
        return numbers
    if isinstance(height_map, RankMap):
        numbers["most_um"] = torch.tensor([height_map.most_um])
    if isinstance(height_map, GratingMap):
        numbers["angles_rad"] = torch.tensor(height_map.angles_rad)
    return numbers | {"cells": torch.tensor([height_map.cells])}


def map_of(numbers: Mapping[str, Tensor]) -> HeightMap:
    """Return the map of numbers.

    Raises:
        ContractError: If they are those of none.
    """
    kind = _KINDS.get(frozenset(numbers))
    if kind is None:
        raise ContractError(
            f"heights cannot follow from {', '.join(sorted(numbers)) or 'nothing'}; wanted is "
            + ", or ".join(", ".join(sorted(names)) for names in _KINDS)
        )
    for name, value in numbers.items():
        _check(name, value)
    if kind is FullMap:
        return FullMap(numbers[HEIGHTS])
    cells = int(numbers["cells"])
    if not 1 < cells <= MAX_CELLS:
        raise ContractError(f"a plate has 2 to {MAX_CELLS} cells along a side; got {cells}")
    if kind is RankMap:
        return _rank_map(numbers, cells)
    if kind is GratingMap:
        return GratingMap(cells, numbers["angles_rad"].tolist(), numbers["profiles_um"])
    if kind is ZernikeMap:
        return ZernikeMap(cells, numbers["coefficients_um"])
    return RadialMap(cells, numbers["profile_um"])


def _check(name: str, value: Tensor) -> None:
    """Refuse numbers of a wrong shape or type, and those that are none."""
    axes = _AXES.get(name, 1)
    dtype = torch.int64 if name == "cells" else None
    right = value.dtype == dtype if dtype else value.is_floating_point()
    single = name in {"cells", "most_um"}
    if value.ndim != axes or not right or value.numel() == 0 or (single and value.numel() != 1):
        raise ContractError(
            f"{name} must be {'one' if single else f'{axes}-dimensional'} and of type "
            f"{'int64' if dtype else 'float'}; got {tuple(value.shape)} {value.dtype}"
        )
    if not bool(torch.isfinite(value).all()):
        raise ContractError(f"{name}: a height is not a finite number")


def _rank_map(numbers: Mapping[str, Tensor], cells: int) -> RankMap:
    v, q = numbers["v"], numbers["q"]
    if v.shape != q.shape or v.shape[0] != cells:
        raise ContractError(
            f"v and q must be (cells, rank) for {cells} cells; got {tuple(v.shape)} and "
            f"{tuple(q.shape)}"
        )
    height_map = RankMap(cells, rank=v.shape[1], most_um=float(numbers["most_um"]))
    with torch.no_grad():
        height_map.v.copy_(v)
        height_map.q.copy_(q)
    return height_map

"""A map and its numbers are the same: there and back, and hostile numbers refused in one line."""

import math

import pytest
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
from camkit.models_def.optics.diffraction.map_numbers import HeightMap, map_of, numbers_of

CELLS = 24


def _random(*shape: int) -> Tensor:
    return torch.rand(*shape, generator=torch.Generator().manual_seed(3))


MAPS: list[HeightMap] = [
    FullMap(_random(CELLS, CELLS)),
    RankMap(CELLS, rank=3, most_um=0.7, start=0.3),
    GratingMap(CELLS, (0.1, 1.3), _random(2, 40)),
    ZernikeMap(CELLS, _random(9)),
    RadialMap(CELLS, _random(15)),
]


@pytest.mark.parametrize("made", MAPS, ids=lambda made: type(made).__name__)
def test_the_heights_of_the_numbers_are_those_of_the_map(made: HeightMap) -> None:
    numbers = numbers_of(made)
    again = map_of(numbers)
    assert type(again) is type(made)
    torch.testing.assert_close(again(), made(), atol=1e-6, rtol=0)
    assert all(not value.requires_grad for value in numbers.values())


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({}, "cannot follow from nothing"),
        ({"v": torch.ones(4, 1)}, "cannot follow from v; wanted is height_um, or"),
        ({"profile_um": torch.ones(4), "cells": torch.tensor([1])}, "2 to 16384 cells"),
        ({"profile_um": torch.ones(4), "cells": torch.tensor([2**40])}, "2 to 16384 cells"),
        ({"profile_um": torch.ones(4), "cells": torch.tensor([4.0])}, "cells must be one"),
        ({"profile_um": torch.ones(4), "cells": torch.tensor([4, 4])}, "cells must be one"),
        ({"profile_um": torch.ones(4, 4), "cells": torch.tensor([4])}, "1-dimensional"),
        ({"profile_um": torch.ones(4).int(), "cells": torch.tensor([4])}, "of type float"),
        ({"profile_um": torch.ones(0), "cells": torch.tensor([4])}, "profile_um must be"),
        (
            {"profile_um": torch.tensor([0.0, math.inf]), "cells": torch.tensor([4])},
            "not a finite number",
        ),
        (
            {
                "v": torch.ones(4, 1),
                "q": torch.ones(5, 1),
                "most_um": torch.ones(1),
                "cells": torch.tensor([4]),
            },
            "v and q must be",
        ),
        (
            {
                "v": torch.ones(4, 1),
                "q": torch.ones(4, 1),
                "most_um": -torch.ones(1),
                "cells": torch.tensor([4]),
            },
            "most_um > 0",
        ),
        (
            {
                "angles_rad": torch.ones(3),
                "profiles_um": torch.ones(2, 9),
                "cells": torch.tensor([4]),
            },
            "one profile a line",
        ),
    ],
)
def test_numbers_of_no_map_are_refused(numbers: dict[str, Tensor], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        map_of(numbers)

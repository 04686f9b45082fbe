"""Glasses that are near in index and Abbe number to one that no catalogue has."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Final

from camkit.models_def.optics.glass.catalogue import GlassCatalogue, builtin_catalogues
from camkit.models_def.optics.glass.dispersion import index_and_abbe
from camkit.models_def.optics.glass.material import Glass

INDEX_STEP: Final = 1e-3
ABBE_STEP: Final = 0.5
"""Differences in n_d and V_d that count alike: two steps of a melt."""
MOST: Final = 3
FARTHEST: Final = 10.0
"""In steps; a glass beyond is near to nothing."""


def near_glasses(
    index_d: float, abbe_number: float, catalogues: Sequence[GlassCatalogue] = ()
) -> tuple[Glass, ...]:
    """Return at most `MOST` glasses of makers near to n_d and V_d, the nearest first.

    Args:
        index_d: At 587.56 nm.
        abbe_number: V_d; 0 for unknown: the index alone counts.
        catalogues: The user's, searched beside those of camkit.
    """

    def distance(numbers: tuple[float, float]) -> float:
        step = (numbers[1] - abbe_number) / ABBE_STEP if abbe_number else 0.0
        return math.hypot((numbers[0] - index_d) / INDEX_STEP, step)

    users_glasses = tuple((g, _numbers(g)) for c in catalogues for g in c.glasses)
    # one of the user's stands for its namesake
    pairs = {g.name: (g, n) for g, n in (*_makers_glasses(), *users_glasses) if n[0]}
    ranked = sorted(pairs.values(), key=lambda pair: (distance(pair[1]), pair[0].name))
    return tuple(glass for glass, n in ranked[:MOST] if distance(n) <= FARTHEST)


def near_text(glasses: Sequence[Glass]) -> str:
    """Return glasses with their n_d and V_d for a message."""
    numbers = ((glass.name, *_numbers(glass)) for glass in glasses)
    return ", ".join(f"{name} ({n:.5f}, {v:.2f})" for name, n, v in numbers)


def _numbers(glass: Glass) -> tuple[float, float]:
    if glass.stated_index_d and glass.stated_abbe_number:
        return glass.stated_index_d, glass.stated_abbe_number
    return index_and_abbe(glass)


@cache
def _makers_glasses() -> tuple[tuple[Glass, tuple[float, float]], ...]:
    catalogues = (c for c in builtin_catalogues() if not c.literature)
    return tuple((g, _numbers(g)) for c in catalogues for g in c.glasses)

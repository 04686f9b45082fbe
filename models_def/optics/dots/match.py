"""A light that is wanted -> a plate of dots that can be etched."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.errors import ContractError
from camkit.models_def.optics.dots.beginning import best_beginning
from camkit.models_def.optics.dots.bottom import best_bottom
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.gerchberg_saxton import gerchberg_saxton
from camkit.models_def.optics.dots.levels import LevelGrid, descend, rounded
from camkit.models_def.optics.dots.merit import Merit
from camkit.models_def.optics.dots.refine import refine
from camkit.models_def.optics.dots.target import FloatGrid, Likeness, likeness
from camkit.models_def.optics.dots.unit import DotPlate, phase_light

STARTS: Final = 4
DESCENTS: Final = 2
"""How many of the best refined starts become levels."""
MOST_LEVELS: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Match:
    """A plate, and how it came about.

    Attributes:
        plate: As etched.
        etched: Of its dots.
        gerchberg_saxton: Of the best start, with any phase.
        refined: Of the phases before they became levels.
        rounded: Of levels by rounding alone.
    """

    plate: DotPlate
    etched: Likeness
    gerchberg_saxton: Likeness
    refined: Likeness
    rounded: Likeness


def check_levels(levels: int) -> None:
    """Refuse a number of levels that masks cannot make.

    Raises:
        ContractError: If it is not 2, 4, 8, ... 64.
    """
    if levels > MOST_LEVELS or levels < 2 or levels & (levels - 1):
        raise ContractError(f"levels are 2, 4, 8, ... {MOST_LEVELS}; got {levels}")


def match_dots(
    target: FloatGrid,
    camera: DotCamera,
    levels: int,
    rng: np.random.Generator,
    starts: int = STARTS,
) -> Match:
    """Find the plate whose dots are nearest to a light.

    Args:
        target: (11, 11), shares of the light that sum to 1, see `to_target`.
        camera: Laser, lens, lattice, cells.
        levels: 2, 4, 8, ... 64.
        rng: For starts, and the order of cells.
        starts: Of Gerchberg and Saxton, each refined; the best ones become levels.

    Raises:
        ContractError: If levels are others.
    """
    check_levels(levels)
    merit = Merit(target=target)
    begun = [gerchberg_saxton(target, camera.cells, rng) for _ in range(starts)]
    refined = [refine(phase, merit) for phase in begun]
    order = sorted(range(starts), key=lambda n: refined[n][1])
    ends: list[tuple[float, int, LevelGrid]] = []
    for start in order[:DESCENTS]:
        level = descend(rounded(refined[start][0], levels), levels, merit, rng)
        light = _plate(camera, level, levels).light
        ends.append((float(merit.of(light)), start, level))
    _, best, level = min(ends, key=lambda end: end[0])
    begin = best_beginning(_plate(camera, level, levels).height_um, camera, target)
    plate = best_bottom(_plate(camera, np.roll(level, begin, (0, 1)), levels), target)
    first = _plate(camera, rounded(refined[best][0], levels), levels)
    return Match(
        plate=plate,
        etched=likeness(plate.light, target),
        gerchberg_saxton=likeness(phase_light(begun[best]), target),
        refined=likeness(phase_light(refined[best][0]), target),
        rounded=likeness(first.light, target),
    )


def _plate(camera: DotCamera, level: LevelGrid, levels: int) -> DotPlate:
    return DotPlate(camera=camera, level=level, levels=levels)

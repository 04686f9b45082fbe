"""Scenes whose truth is known to the last pixel: edges without halo, stars and discs on black.

Photographs are sharpened by those who took them, so an edge of theirs may carry a halo, and few
show stars. A network that is to leave clean edges clean must see some.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray

Generator = np.random.Generator
Plane = NDArray[np.float64]

MOST_SHAPES: Final = 3
TINT: Final = 0.15
"""Standard deviation of the logarithm of a colour."""
DARK: Final = (0.004, 0.3)
RATIO: Final = (1.15, 40.0)
BRIGHTEST: Final = 1.2
SKY: Final = (2e-4, 4e-3)
STARS_PER_PX: Final = 6e-4
STAR_LIGHT: Final = (0.02, 6.0)
"""Of its brightest pixel, 1 the white of the picture."""
STAR_SIGMA_PX: Final = (0.35, 0.7)
STAR_REACH_PX: Final = 4
DISC_SHARE: Final = (0.05, 0.6)
"""Radius over the side."""


def edges(rng: Generator, side_px: int) -> FloatArray:
    """Draw one to three straight edges between even colours, (3, side, side) linear Rec.709.

    Every edge falls within one pixel: pixels hold the area that lies on either side.
    """
    y, x = np.mgrid[:side_px, :side_px] - (side_px - 1) / 2
    dark = _log_uniform(rng, DARK)
    scene = np.ones((3, side_px, side_px)) * _colour(rng, dark)
    for _ in range(int(rng.integers(1, MOST_SHAPES + 1))):
        turn, off = rng.uniform(0, 2 * np.pi), rng.uniform(-0.25, 0.25) * side_px
        cover = np.clip(x * np.cos(turn) + y * np.sin(turn) - off + 0.5, 0, 1)
        level = min(dark * _log_uniform(rng, RATIO), BRIGHTEST)
        scene += cover * (_colour(rng, level) - scene)
    return np.asarray(scene, np.float32)


def night(rng: Generator, side_px: int) -> FloatArray:
    """Draw stars on a dark sky, and in every second scene a disc, (3, side, side)."""
    sky = _colour(rng, _log_uniform(rng, SKY))
    scene = np.ones((3, side_px, side_px)) * sky
    if rng.random() < 0.5:
        y, x = np.mgrid[:side_px, :side_px] - rng.uniform(0, side_px, (2, 1, 1))
        radius = rng.uniform(*DISC_SHARE) * side_px
        cover = np.clip(radius - np.hypot(x, y) + 0.5, 0, 1)
        scene += cover * (_colour(rng, rng.uniform(0.05, 1.0)) - scene)
    for _ in range(int(rng.poisson(STARS_PER_PX * side_px**2))):
        _add_star(rng, scene)
    return np.asarray(scene, np.float32)


def _add_star(rng: Generator, scene: Plane) -> None:
    side_px = scene.shape[1]
    place = rng.uniform(STAR_REACH_PX, side_px - 1 - STAR_REACH_PX, 2)
    top, left = (int(v) - STAR_REACH_PX for v in place)
    y, x = np.mgrid[: 2 * STAR_REACH_PX + 1, : 2 * STAR_REACH_PX + 1]
    squared = (y + top - place[0]) ** 2 + (x + left - place[1]) ** 2
    spot = np.exp(-squared / (2 * rng.uniform(*STAR_SIGMA_PX) ** 2))
    window = np.s_[:, top : top + len(y), left : left + len(x)]
    scene[window] += _colour(rng, _log_uniform(rng, STAR_LIGHT)) * spot


def _log_uniform(rng: Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))


def _colour(rng: Generator, level: float) -> Plane:
    """Give a colour (3, 1, 1) near grey."""
    return np.asarray(level * np.exp(rng.normal(0, TINT, (3, 1, 1))))

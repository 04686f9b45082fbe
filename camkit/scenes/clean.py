"""Scenes whose truth is known to the last pixel: edges without halo, patches, stars, discs, lamps.

Photographs are sharpened by those who took them, so an edge of theirs may carry a halo, and few
show stars. A network that is to leave clean edges clean must see some in training, and `camkit
stress` counts what it adds to them.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

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
MOST_LAMPS: Final = 3
LAMP_LIGHT: Final = (2.0, 200.0)
"""1 the white of the picture."""
LAMP_RADIUS_PX: Final = (0.7, 12.0)
PATCH_PX: Final = (12.0, 96.0)
PATCH_LIGHT: Final = (0.02, 1.0)
"""Of the brightest colour of a patch."""
FAINTEST: Final = 0.03
"""Light of a patch's faintest colour over that of its brightest: a deep primary has two of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disc:
    """A disc on a sky.

    Attributes:
        center_px: (y, x).
        radius_px: Where the sky begins.
    """

    center_px: tuple[float, float]
    radius_px: float


def edges(rng: Generator, side_px: int) -> FloatArray:
    """Draw one to three straight edges between even colours, (3, side, side) linear Rec.709.

    Every edge falls within one pixel, by its distance from the middle of the pixel: up to 0.04 of
    the step from the area that lies on either side.
    """
    y, x = np.mgrid[:side_px, :side_px] - (side_px - 1) / 2
    dark = _log_uniform(rng, DARK)
    scene = np.ones((3, side_px, side_px)) * _colour(rng, dark)
    for _ in range(int(rng.integers(1, MOST_SHAPES + 1))):
        turn, offset = rng.uniform(0, 2 * np.pi), rng.uniform(-0.25, 0.25) * side_px
        cover = np.clip(x * np.cos(turn) + y * np.sin(turn) - offset + 0.5, 0, 1)
        level = min(dark * _log_uniform(rng, RATIO), BRIGHTEST)
        scene += cover * (_colour(rng, level) - scene)
    return np.asarray(scene, np.float32)


def patches(rng: Generator, side_px: int) -> FloatArray:
    """Draw a chart of even patches in any colour, deep primaries too, (3, side, side)."""
    pitch = _log_uniform(rng, PATCH_PX)
    cells = int(np.ceil(side_px / pitch)) + 1
    darkest, brightest = np.log(PATCH_LIGHT)
    bright = np.exp(rng.uniform(darkest, brightest, (1, cells, cells)))
    shares = np.exp(rng.uniform(np.log(FAINTEST), 0, (3, cells, cells)))
    deep = rng.random((1, cells, cells)) < 0.3
    shares = np.where(deep, np.where(rng.random((3, cells, cells)) < 0.5, FAINTEST, 1.0), shares)
    colours = bright * shares / shares.max(axis=0)
    start_y, start_x = rng.uniform(0, pitch, 2)
    y, x = ((np.arange(side_px) + start) / pitch for start in (start_y, start_x))
    chart = colours[:, y.astype(int)][:, :, x.astype(int)]
    return np.asarray(chart, np.float32)


def night(rng: Generator, side_px: int) -> FloatArray:
    """Draw stars on a dark sky, and in every second scene a disc, (3, side, side)."""
    scene = _sky(rng, (side_px, side_px), _log_uniform(rng, SKY))
    if rng.random() < 0.5:
        y, x = rng.uniform(0, side_px, 2)
        disc = Disc(center_px=(y, x), radius_px=rng.uniform(*DISC_SHARE) * side_px)
        _add_disc(scene, disc, _colour(rng, rng.uniform(0.05, 1.0)))
    for _ in range(int(rng.poisson(STARS_PER_PX * side_px**2))):
        place = rng.uniform(STAR_REACH_PX, side_px - 1 - STAR_REACH_PX, 2)
        sigma_px = rng.uniform(*STAR_SIGMA_PX)
        _add_star(scene, place, sigma_px, _colour(rng, _log_uniform(rng, STAR_LIGHT)))
    return np.asarray(scene, np.float32)


def with_lamps(rng: Generator, scene: FloatArray) -> FloatArray:
    """Draw one to three lamps, discs far brighter than white, into a (3, h, w) scene."""
    lit = scene.astype(np.float64)
    for _ in range(int(rng.integers(1, MOST_LAMPS + 1))):
        y, x = rng.uniform(0, scene.shape[1:])
        disc = Disc(center_px=(y, x), radius_px=_log_uniform(rng, LAMP_RADIUS_PX))
        _add_disc(lit, disc, _colour(rng, _log_uniform(rng, LAMP_LIGHT)))
    return np.asarray(lit, np.float32)


def star_field(
    rng: Generator, size_px: tuple[int, int], *, light: float, sky: float, pitch_px: int
) -> FloatArray:
    """Draw stars that stand apart, one in every cell of a grid.

    Args:
        rng: Of places, sizes and colours.
        size_px: (height, width).
        light: Of the brightest pixel of a star that lies in its middle, 1 the white.
        sky: Light of the sky.
        pitch_px: Side of a cell; a star lies within an eighth of it from the cell's middle.

    Returns:
        (3, height, width) linear Rec.709.
    """
    scene = _sky(rng, size_px, sky)
    middles = (np.arange(pitch_px / 2, side - pitch_px / 2 + 1, pitch_px) for side in size_px)
    cells = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 2)
    for place in cells + rng.uniform(-pitch_px / 8, pitch_px / 8, cells.shape):
        _add_star(scene, place, rng.uniform(*STAR_SIGMA_PX), _colour(rng, light))
    return np.asarray(scene, np.float32)


def disc_on_black(
    rng: Generator, size_px: tuple[int, int], disc: Disc, *, light: float, sky: float
) -> FloatArray:
    """Draw an even disc on a dark sky, (3, height, width) linear Rec.709.

    Args:
        rng: Of the colours.
        size_px: (height, width).
        disc: Where it lies; pixels at its limb hold the area that it covers.
        light: Of the disc, 1 the white.
        sky: Light of the sky.
    """
    scene = _sky(rng, size_px, sky)
    _add_disc(scene, disc, _colour(rng, light))
    return np.asarray(scene, np.float32)


def _sky(rng: Generator, size_px: tuple[int, int], light: float) -> Plane:
    return np.ones((3, *size_px)) * _colour(rng, light)


def _add_disc(scene: Plane, disc: Disc, colour: Plane) -> None:
    y, x = np.mgrid[: scene.shape[1], : scene.shape[2]] - np.reshape(disc.center_px, (2, 1, 1))
    scene += np.clip(disc.radius_px - np.hypot(x, y) + 0.5, 0, 1) * (colour - scene)


def _add_star(scene: Plane, place: Plane, sigma_px: float, colour: Plane) -> None:
    """Add a spot at least `STAR_REACH_PX` inside the scene."""
    top, left = (int(v) - STAR_REACH_PX for v in place)
    y, x = np.mgrid[: 2 * STAR_REACH_PX + 1, : 2 * STAR_REACH_PX + 1]
    squared = (y + top - place[0]) ** 2 + (x + left - place[1]) ** 2
    window = np.s_[:, top : top + len(y), left : left + len(x)]
    scene[window] += colour * np.exp(-squared / (2 * sigma_px**2))


def _log_uniform(rng: Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))


def _colour(rng: Generator, level: float) -> Plane:
    """Return a colour (3, 1, 1) near grey."""
    return np.asarray(level * np.exp(rng.normal(0, TINT, (3, 1, 1))))

"""Procedural scenes: sharp linear pictures that need no data.

A scene is built back to front: a gradient sky with cloud-like texture, dead leaves (which give the
statistics of natural images), panels of glyphs, gratings and stars, and point lights far above
white. The number of things follows the area, so that a crop of a large scene looks like a small
scene.
"""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.scenes.leaves import add_leaves, box_around
from camkit.scenes.lettering import set_text
from camkit.scenes.texture import Generator, cut_texture, draw_colour, draw_count, make_texture

AREA_PER_PANEL_PX: Final = 220_000
AREA_PER_LIGHT_PX: Final = 40_000


def procedural_scene(seed: int, height: int, width: int) -> FloatArray:
    """Return a sharp scene; the same seed and size give the same scene.

    Args:
        seed: Any non-negative integer.
        height: Rows in pixels.
        width: Columns in pixels.

    Returns:
        (3, height, width) float32, linear Rec.709, >= 0; diffuse surfaces lie in 0..1, lights
        reach about 60.

    Raises:
        ContractError: If the size is not positive or the seed is negative.
    """
    if height < 1 or width < 1 or seed < 0:
        raise ContractError(
            f"a scene needs a positive size and a seed >= 0; got {height} x {width}, seed {seed}"
        )
    rng = np.random.default_rng(seed)
    textures = [make_texture(rng, slope) for slope in (0.7, 1.0, 1.3)]
    scene = _sky(rng, height, width, textures[2])
    add_leaves(rng, scene, textures)
    for _ in range(draw_count(rng, height * width / AREA_PER_PANEL_PX)):
        _add_panel(rng, scene)
    for _ in range(draw_count(rng, height * width / AREA_PER_LIGHT_PX)):
        _add_light(rng, scene)
    return scene


def _sky(rng: Generator, height: int, width: int, texture: FloatArray) -> FloatArray:
    """Draw the backdrop: a colour gradient with a soft texture."""
    top, bottom = draw_colour(rng), draw_colour(rng)
    ramp = np.linspace(0, 1, height, dtype=np.float32)[:, None]
    clouds = np.exp(0.15 * cut_texture(rng, texture, height, width))
    planes = [(top[c] + (bottom[c] - top[c]) * ramp) * clouds for c in range(3)]
    return np.stack(planes).astype(np.float32)


def _add_panel(rng: Generator, scene: FloatArray) -> None:
    """Draw a rectangle of glyphs, a grating or a star on the scene."""
    _, height, width = scene.shape
    rows = min(height, int(rng.integers(48, 280)))
    columns = min(width, int(rng.integers(64, 420)))
    top = int(rng.integers(0, height - rows + 1))
    left = int(rng.integers(0, width - columns + 1))
    kind = rng.choice(["text", "grating", "star"], p=[0.6, 0.25, 0.15])
    draw = {"text": set_text, "grating": _grating, "star": _star}[str(kind)]
    alpha = draw(rng, rows, columns)
    paper, ink = draw_colour(rng), draw_colour(rng)
    if rng.random() < 0.5:
        paper, ink = np.full(3, 0.8, np.float32), np.full(3, 0.03, np.float32)
    panel = paper[:, None, None] + (ink - paper)[:, None, None] * alpha
    scene[:, top : top + rows, left : left + columns] = panel


def _grating(rng: Generator, rows: int, columns: int) -> FloatArray:
    """Draw a sine or bar grating whose frequency may sweep along it."""
    angle = rng.uniform(0, np.pi)
    y = np.arange(rows)[:, None]
    x = np.arange(columns)[None, :]
    position = x * np.cos(angle) + y * np.sin(angle)
    first = rng.uniform(0.01, 0.1)
    sweep = rng.uniform(0, 0.25) / (rows + columns)
    wave = np.sin(2 * np.pi * (first + 0.5 * sweep * np.abs(position)) * position)
    if rng.random() < 0.5:
        wave = np.clip(3 * wave, -1, 1)
    return np.asarray(0.5 + 0.5 * wave, dtype=np.float32)


def _star(rng: Generator, rows: int, columns: int) -> FloatArray:
    """Draw a Siemens star, fading to grey where its spokes are finer than 3 pixels."""
    y = np.arange(rows)[:, None] - (rows - 1) / 2
    x = np.arange(columns)[None, :] - (columns - 1) / 2
    spokes = int(rng.integers(8, 40))
    wave = np.sin(spokes * np.arctan2(y, x))
    spoke_px = 2 * np.pi * np.hypot(y, x) / spokes
    contrast = np.clip(spoke_px / 3 - 1, 0, 1)
    return np.asarray(0.5 + 0.5 * np.clip(2 * wave, -1, 1) * contrast, dtype=np.float32)


def _add_light(rng: Generator, scene: FloatArray) -> None:
    """Add a small lamp, brighter than white."""
    _, height, width = scene.shape
    radius = float(rng.uniform(0.6, 4.0))
    box = box_around(scene, rng.random() * height, rng.random() * width, radius + 1)
    if box is None:
        return
    region, dy, dx = box
    power = np.float32(np.exp(rng.uniform(0, np.log(60.0))))
    tint = (1 + 0.3 * rng.uniform(-1, 1, 3)).astype(np.float32)[:, None, None]
    disc = np.clip(np.float32(radius) - np.hypot(dy, dx) + 0.5, 0, 1)
    region += power * tint * disc

"""Procedural scenes: sharp linear pictures that need no data.

A scene is built back to front: a gradient sky with cloud-like texture, dead leaves (occluding
textured discs and rectangles whose sizes follow a cubic power law, which gives the statistics of
natural images), panels of glyphs, gratings and stars, and point lights far above white. The
number of things follows the area, so that a crop of a large scene looks like a small scene.

References: Lee, Mumford and Huang 2001, "Occlusion models for natural images" (dead leaves with
size density r^-3); Field 1987 (amplitude spectra that fall as 1/f).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.errors import ContractError

TEXTURE_SIDE_PX: Final = 512
LEAF_LAYERS: Final = 2.5
LEAF_MIN_PX: Final = 4.0
LEAF_MAX_PX: Final = 160.0
GLYPH_COUNT: Final = 26
AREA_PER_PANEL_PX: Final = 220_000
AREA_PER_LIGHT_PX: Final = 40_000

Generator = np.random.Generator
Colour = NDArray[np.float32]


def procedural_scene(seed: int, height: int, width: int) -> FloatArray:
    """Give a sharp scene; the same seed and size give the same scene.

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
    textures = [_texture(rng, slope) for slope in (0.7, 1.0, 1.3)]
    scene = _sky(rng, height, width, textures[2])
    _add_leaves(rng, scene, textures)
    for _ in range(_count(rng, height * width / AREA_PER_PANEL_PX)):
        _add_panel(rng, scene)
    for _ in range(_count(rng, height * width / AREA_PER_LIGHT_PX)):
        _add_light(rng, scene)
    return scene


def _count(rng: Generator, mean: float) -> int:
    return int(rng.poisson(mean))


def _colour(rng: Generator) -> Colour:
    """Draw a surface colour: reflectance from dark to light, saturation mostly low."""
    value = float(np.exp(rng.uniform(np.log(0.01), np.log(0.9))))
    tint = 1 + rng.normal(0, rng.choice([0.05, 0.2, 0.6]), 3)
    return np.clip(value * tint, 0.0, 1.0).astype(np.float32)


def _texture(rng: Generator, slope: float) -> FloatArray:
    """Make a periodic texture whose amplitude falls as f^-slope; mean 0, deviation 1."""
    side = TEXTURE_SIDE_PX
    fy = np.fft.fftfreq(side)[:, None]
    fx = np.fft.rfftfreq(side)[None, :]
    radius = np.hypot(fy, fx)
    radius[0, 0] = 1.0
    spectrum = np.fft.rfft2(rng.standard_normal((side, side))) * radius**-slope
    spectrum[0, 0] = 0.0
    field = np.fft.irfft2(spectrum, s=(side, side))
    return np.asarray(field / field.std(), dtype=np.float32)


def _cut(rng: Generator, texture: FloatArray, height: int, width: int) -> FloatArray:
    """Cut a piece of a periodic texture, at most its side, at a random place."""
    y, x = rng.integers(0, TEXTURE_SIDE_PX, 2)
    if y + height <= TEXTURE_SIDE_PX and x + width <= TEXTURE_SIDE_PX:
        return texture[y : y + height, x : x + width]
    rows = np.arange(y, y + height) % TEXTURE_SIDE_PX
    columns = np.arange(x, x + width) % TEXTURE_SIDE_PX
    return np.asarray(texture[rows[:, None], columns])


def _sky(rng: Generator, height: int, width: int, texture: FloatArray) -> FloatArray:
    """Make the backdrop: a colour gradient with a soft texture."""
    top, bottom = _colour(rng), _colour(rng)
    ramp = np.linspace(0, 1, height, dtype=np.float32)[:, None]
    clouds = np.exp(0.15 * _cut(rng, texture, height, width))
    planes = [(top[c] + (bottom[c] - top[c]) * ramp) * clouds for c in range(3)]
    return np.stack(planes).astype(np.float32)


def _leaf_radii(rng: Generator, height: int, width: int) -> NDArray[np.float64]:
    """Draw radii with density r^-3, enough to cover the picture LEAF_LAYERS times."""
    largest = max(LEAF_MIN_PX * 2, min(LEAF_MAX_PX, 0.35 * min(height, width)))
    log_span = np.log(largest / LEAF_MIN_PX)
    mean_area = 2 * np.pi * LEAF_MIN_PX**2 * log_span
    number = _count(rng, LEAF_LAYERS * height * width / mean_area)
    low, high = LEAF_MIN_PX**-2, largest**-2
    return np.asarray((low - rng.random(number) * (low - high)) ** -0.5)


def _add_leaves(rng: Generator, scene: FloatArray, textures: list[FloatArray]) -> None:
    _, height, width = scene.shape
    radii = _leaf_radii(rng, height, width)
    centres = rng.random((radii.size, 2)) * (height, width)
    kinds = rng.integers(0, 3, radii.size)
    angles = rng.uniform(0, np.pi, radii.size)
    depths = np.abs(rng.normal(0, 0.25, radii.size)).astype(np.float32)
    # A leaf in three stays bare: the flat patches on which noise and ringing are seen.
    depths[rng.random(radii.size) < 1 / 3] = 0
    for radius, (cy, cx), kind, angle, depth in zip(
        radii, centres, kinds, angles, depths, strict=True
    ):
        box = _box(scene, cy, cx, radius)
        if box is None:
            continue
        region, dy, dx = box
        alpha = _leaf_mask(int(kind), radius, angle, dy, dx)
        paint = _colour(rng)[:, None, None]
        if depth > 0:
            cut = _cut(rng, textures[int(kind)], region.shape[1], region.shape[2])
            paint = paint * np.exp(depth * cut)
        region += alpha * (paint - region)


def _box(
    scene: FloatArray, cy: float, cx: float, radius: float
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Give the view of the scene around a centre and the offsets (dy, dx) of its pixels."""
    _, height, width = scene.shape
    top, left = max(0, int(cy - radius - 1)), max(0, int(cx - radius - 1))
    bottom, right = min(height, int(cy + radius + 2)), min(width, int(cx + radius + 2))
    if top >= bottom or left >= right:
        return None
    dy = (np.arange(top, bottom, dtype=np.float32) - np.float32(cy))[:, None]
    dx = (np.arange(left, right, dtype=np.float32) - np.float32(cx))[None, :]
    return scene[:, top:bottom, left:right], dy, dx


def _leaf_mask(
    kind: int, radius: float, angle: float, dy: FloatArray, dx: FloatArray
) -> FloatArray:
    """Give the coverage (0..1, anti-aliased over one pixel) of a disc, ellipse or rectangle."""
    if kind == 0:
        return np.asarray(np.clip(np.float32(radius) - np.hypot(dy, dx) + 0.5, 0, 1))
    c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    u, v = c * dx + s * dy, c * dy - s * dx
    r = np.float32(radius)
    if kind == 1:
        return np.asarray(np.clip((r - np.hypot(u, 2 * v)) / 1.5 + 0.5, 0, 1))
    inside = np.minimum(0.8 * r - np.abs(u), 0.5 * r - np.abs(v))
    return np.clip(inside + 0.5, 0, 1)


def _add_panel(rng: Generator, scene: FloatArray) -> None:
    """Put a rectangle of glyphs, a grating or a star on the scene."""
    _, height, width = scene.shape
    rows = min(height, int(rng.integers(48, 280)))
    columns = min(width, int(rng.integers(64, 420)))
    top = int(rng.integers(0, height - rows + 1))
    left = int(rng.integers(0, width - columns + 1))
    kind = rng.choice(["text", "grating", "star"], p=[0.6, 0.25, 0.15])
    draw = {"text": _text, "grating": _grating, "star": _star}[str(kind)]
    alpha = draw(rng, rows, columns)
    paper, ink = _colour(rng), _colour(rng)
    if rng.random() < 0.5:
        paper, ink = np.full(3, 0.8, np.float32), np.full(3, 0.03, np.float32)
    panel = paper[:, None, None] + (ink - paper)[:, None, None] * alpha
    scene[:, top : top + rows, left : left + columns] = panel


def _text(rng: Generator, rows: int, columns: int) -> FloatArray:
    """Set lines of made-up glyphs: ink coverage 0..1."""
    cell = min(int(rng.integers(9, 40)), rows, columns)
    alphabet = [_glyph(rng, cell) for _ in range(GLYPH_COUNT)]
    ink = np.zeros((rows, columns), dtype=np.float32)
    for y in range(0, rows - cell + 1, int(cell * 1.3)):
        for x in range(0, columns - cell + 1, int(cell * 0.8)):
            if rng.random() < 0.85:
                glyph = alphabet[int(rng.integers(GLYPH_COUNT))]
                spot = ink[y : y + cell, x : x + cell]
                np.maximum(spot, glyph, out=spot)
    return ink


def _glyph(rng: Generator, cell: int) -> FloatArray:
    """Draw two to five strokes between the nodes of a 3 x 4 lattice."""
    node = np.stack(np.meshgrid(np.linspace(0.1, 0.9, 4), np.linspace(0.15, 0.7, 3)), -1)
    nodes = node.reshape(-1, 2) * (cell - 1)
    thick = max(0.5, cell * float(rng.uniform(0.04, 0.09)))
    y = np.arange(cell)[:, None]
    x = np.arange(cell)[None, :]
    ink = np.zeros((cell, cell))
    for _ in range(int(rng.integers(2, 6))):
        (ay, ax), (by, bx) = nodes[rng.choice(len(nodes), 2, replace=False)]
        length2 = (by - ay) ** 2 + (bx - ax) ** 2
        t = np.clip(((y - ay) * (by - ay) + (x - ax) * (bx - ax)) / length2, 0, 1)
        gap = np.hypot(y - ay - t * (by - ay), x - ax - t * (bx - ax))
        np.maximum(ink, np.clip(thick - gap + 0.5, 0, 1), out=ink)
    return ink.astype(np.float32)


def _grating(rng: Generator, rows: int, columns: int) -> FloatArray:
    """Draw a sine or bar grating whose frequency may sweep along it."""
    angle = rng.uniform(0, np.pi)
    y = np.arange(rows)[:, None]
    x = np.arange(columns)[None, :]
    along = x * np.cos(angle) + y * np.sin(angle)
    first = rng.uniform(0.01, 0.1)
    sweep = rng.uniform(0, 0.25) / (rows + columns)
    wave = np.sin(2 * np.pi * (first + 0.5 * sweep * np.abs(along)) * along)
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
    box = _box(scene, rng.random() * height, rng.random() * width, radius + 1)
    if box is None:
        return
    region, dy, dx = box
    power = np.float32(np.exp(rng.uniform(0, np.log(60.0))))
    tint = (1 + 0.3 * rng.uniform(-1, 1, 3)).astype(np.float32)[:, None, None]
    disc = np.clip(np.float32(radius) - np.hypot(dy, dx) + 0.5, 0, 1)
    region += power * tint * disc

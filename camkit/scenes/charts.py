"""Charts on which the laws of a picture are held: lamps of known strength, patches of any colour.

Truth is known to the last pixel, so what a camera loses is told by the picture alone.
"""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

LAMP_RADII_PX: Final = (1.5, 3.0, 6.0, 12.0)
LAMP_LIGHTS: Final = (2.0, 8.0, 40.0, 200.0)
"""1 is white."""
LAMP_PITCH_PX: Final = 96
GROUND: Final = 0.04
PATCH_PX: Final = 96
PATCH_COLUMNS: Final = 6
PATCH_INNER_PX: Final = 24
"""Side of the middle of a patch, which is judged."""
SHARES: Final = (1.0, 0.3, 0.05)
"""Of a patch's brightest colour: 27 colours from white to deep primaries."""

Labels = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A scene and its parts.

    Attributes:
        scene: (3, h, w) float32 linear Rec.709.
        labels: (h, w), 0 for the ground, n for part n - 1.
        names: Of the parts.
    """

    scene: FloatArray
    labels: Labels
    names: tuple[str, ...]


def lamp_chart() -> Chart:
    """Draw discs of four sizes, a row each, and four strengths on a dark ground."""
    rows, columns = len(LAMP_RADII_PX), len(LAMP_LIGHTS)
    size = rows * LAMP_PITCH_PX, columns * LAMP_PITCH_PX
    scene = np.full((3, *size), GROUND, np.float64)
    labels = np.zeros(size, np.intp)
    y, x = np.mgrid[: size[0], : size[1]]
    for (i, radius), (j, light) in product(enumerate(LAMP_RADII_PX), enumerate(LAMP_LIGHTS)):
        middle = [(n + 0.5) * LAMP_PITCH_PX + 0.25 * (i - j) for n in (i, j)]
        cover = np.clip(radius - np.hypot(y - middle[0], x - middle[1]) + 0.5, 0, 1)
        scene += cover * (light - scene)
        labels[cover > 0] = i + 1
    names = tuple(f"lamps of {2 * radius:g} px" for radius in LAMP_RADII_PX)
    return Chart(scene=scene.astype(np.float32), labels=labels, names=names)


def patch_chart(level: float) -> Chart:
    """Draw 27 patches whose colours have every ratio of `SHARES`.

    Args:
        level: Light of the brightest colour of a patch.
    """
    colours = [np.array(shares) / max(shares) for shares in product(SHARES, repeat=3)]
    rows = -(-len(colours) // PATCH_COLUMNS)
    size = rows * PATCH_PX, PATCH_COLUMNS * PATCH_PX
    scene = np.full((3, *size), 0.18 * level, np.float32)
    labels = np.zeros(size, np.intp)
    rim = (PATCH_PX - PATCH_INNER_PX) // 2
    for number, colour in enumerate(colours):
        top, left = (PATCH_PX * n for n in divmod(number, PATCH_COLUMNS))
        scene[:, top : top + PATCH_PX, left : left + PATCH_PX] = level * colour[:, None, None]
        inner = np.s_[top + rim : top + PATCH_PX - rim, left + rim : left + PATCH_PX - rim]
        labels[inner] = number + 1
    names = tuple(
        f"a patch of {', '.join(f'{level * share:.3g}' for share in colour)}" for colour in colours
    )
    return Chart(scene=scene, labels=labels, names=names)

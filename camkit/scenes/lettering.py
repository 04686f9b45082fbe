"""Lines of made-up glyphs."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.scenes.texture import Generator

GLYPH_COUNT: Final = 26


def set_text(rng: Generator, rows: int, columns: int) -> FloatArray:
    """Draw lines of made-up glyphs.

    Returns:
        (rows, columns) float32, how much of a pixel is ink, 0..1.
    """
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
        (y0, x0), (y1, x1) = nodes[rng.choice(len(nodes), 2, replace=False)]
        length2 = (y1 - y0) ** 2 + (x1 - x0) ** 2
        t = np.clip(((y - y0) * (y1 - y0) + (x - x0) * (x1 - x0)) / length2, 0, 1)
        gap = np.hypot(y - y0 - t * (y1 - y0), x - x0 - t * (x1 - x0))
        np.maximum(ink, np.clip(thick - gap + 0.5, 0, 1), out=ink)
    return ink.astype(np.float32)

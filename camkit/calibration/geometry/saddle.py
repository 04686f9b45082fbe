"""Corners of a board that blur has rounded: saddles of the light.

Where blur is wide, a corner is the saddle of a smooth surface. A polynomial of the third degree is
fitted around it, weighted by a Gaussian, and its stationary point is the corner: blur that is the
same in opposite directions leaves it where it was.

References: Lucchese and Mitra 2002, "Using saddle points for subpixel feature detection".
"""

from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.calibration.geometry.camera_model import FloatGrid

MOST_SAMPLES: Final = 24
"""From the middle of a window to its side."""
_POWERS: Final = tuple((i, j) for i in range(4) for j in range(4 - i))
_ROUNDS: Final = 3
_NEWTON_STEPS: Final = 6
_MOST_STEP: Final = 0.5


def refine_saddles(grey: FloatArray, rough: FloatGrid, radius_px: float) -> FloatGrid:
    """Refine corners.

    Args:
        grey: (h, w).
        rough: (corner, 2) x, y in px.
        radius_px: Of the window.

    Returns:
        (corner, 2) x, y in px; NaN where there is no saddle within the window.
    """
    count = min(MOST_SAMPLES, int(np.ceil(radius_px)))
    line = np.linspace(-1, 1, 2 * count + 1)
    v, u = (part.ravel() for part in np.meshgrid(line, line, indexing="ij"))
    weight = np.exp(-(u**2 + v**2) / 2)
    table = np.stack([u**i * v**j for i, j in _POWERS], axis=-1)
    inverse = np.linalg.pinv(table * weight[:, None]) * weight
    corners = rough
    for _ in range(_ROUNDS):
        x, y = (
            (corners[:, i : i + 1] + radius_px * part).astype(np.float32)
            for i, part in enumerate((u, v))
        )
        light = cv2.remap(grey, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        step = _stationary(np.asarray(light, dtype=np.float64) @ inverse.T)
        corners = corners + radius_px * step
    return corners


def _stationary(polynomials: FloatGrid) -> FloatGrid:
    """Return the saddle (corner, 2) of each polynomial, by Newton from the middle."""
    at = np.zeros((len(polynomials), 2))
    for _ in range(_NEWTON_STEPS):
        slope = np.stack([_value(polynomials, at, 1, 0), _value(polynomials, at, 0, 1)], axis=-1)
        xx, xy, yy = (_value(polynomials, at, *n) for n in ((2, 0), (1, 1), (0, 2)))
        turned = np.stack(
            [yy * slope[:, 0] - xy * slope[:, 1], xx * slope[:, 1] - xy * slope[:, 0]]
        )
        bend = xx * yy - xy**2
        step = -turned.T / np.where(bend < 0, bend, np.nan)[:, None]
        at = at + np.clip(step, -_MOST_STEP, _MOST_STEP)
    return np.where((np.abs(at) < 1).all(axis=1, keepdims=True), at, np.nan)


def _value(polynomials: FloatGrid, at: FloatGrid, by_x: int, by_y: int) -> FloatGrid:
    """Return a derivative of each polynomial at its place."""
    value = np.zeros(len(at))
    for number, (i, j) in enumerate(_POWERS):
        if i >= by_x and j >= by_y:
            scale = (i if by_x else 1) * (i - 1 if by_x > 1 else 1)
            scale *= (j if by_y else 1) * (j - 1 if by_y > 1 else 1)
            powers = at[:, 0] ** (i - by_x) * at[:, 1] ** (j - by_y)
            value = value + scale * powers * polynomials[:, number]
    return value

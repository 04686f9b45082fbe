"""A night scene of a seed."""

from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.night.canvas import new_canvas
from camkit.runtime.kinds.hdr.night.ground import add_reflection
from camkit.runtime.kinds.hdr.night.lamp import MOST_POWER
from camkit.runtime.kinds.hdr.night.places import PLACES
from camkit.runtime.kinds.hdr.night.shading import shade

STREAM: Final = 0x6E69676874
"""Keeps the numbers drawn here apart from those of other sources with the same seed."""
SHARES: Final = (0.0008, 0.06)
"""Of the pixels that shine above white, aimed at; uniform in its logarithm."""
MEDIANS: Final = (0.02, 0.08)
"""Of what is lit by the lamps; likewise."""


def night_scene(seed: int, height: int, width: int) -> FloatArray:
    """Return a scene at night; the same seed and size give the same scene.

    Args:
        seed: Any non-negative integer.
        height: Rows in pixels.
        width: Columns in pixels.

    Returns:
        (3, height, width) float32, linear Rec.709; surfaces lie in 0..1, lamps reach from 1.5 to
        `MOST_POWER`, which nothing exceeds.

    Raises:
        ContractError: If the size is not positive or the seed is negative.
    """
    if height < 1 or width < 1 or seed < 0:
        raise ContractError(
            f"a scene needs a positive size and a seed >= 0; got {height} x {width}, seed {seed}"
        )
    rng = np.random.default_rng((seed, STREAM))
    canvas = new_canvas(rng, height, width)
    share, median = (float(np.exp(rng.uniform(*np.log(span)))) for span in (SHARES, MEDIANS))
    paints = list(PLACES)
    paint = paints[int(rng.choice(len(paints), p=list(PLACES.values())))]
    mirror = paint(rng, canvas, share)
    scene = shade(rng, canvas, median)
    if mirror is not None:
        add_reflection(scene, canvas.gloss, mirror)
    return np.minimum(scene, np.float32(MOST_POWER), out=scene)

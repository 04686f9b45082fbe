"""The two-point star: what dust that a wiper left on a windshield writes beside a light.

The thesis names its parameters (alpha = 1, beta = 0.00025, gamma = 0, m = 0.014, "the same
parameterization" as Rouf 2011) and prints no formula. Read here as: alpha straight on, and two arms
of beta exp(-m r) per pixel, r in pixels; so the arms hold 2 beta / m = 3.6 % beside it. gamma = 0
takes the third term away, whatever it is. They are numbers of the kernel, not of eq. (5.9).

References: Sun 2021, section 5.7.1; Rouf et al. 2011.
"""

import math

import numpy as np

from camkit.arrays import FloatArray
from camkit.models_def.kinds.hdr.thesis_recipe import GlareRecipe


def star_kernel(glare: GlareRecipe, angle_rad: float) -> FloatArray:
    """Return the kernel (n, n) of sum 1, n = 2 reach + 1.

    Args:
        glare: Its numbers.
        angle_rad: Of the arms from the vertical, within 45 degrees; positive where the upper one
            leans to the right.
    """
    reach = glare.reach_px
    rows = np.arange(-reach, reach + 1)
    offsets = -np.tan(angle_rad) * rows
    # one sample of the line per row stands for its length within that row
    length = 1 / math.cos(angle_rad)
    light = glare.beta * length * np.exp(-glare.m * length * np.abs(rows))
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1))
    left_columns = np.floor(offsets).astype(int)
    share = offsets - left_columns
    for column, part in ((left_columns, 1 - share), (left_columns + 1, share)):
        inside = np.abs(column) <= reach
        kernel[rows[inside] + reach, column[inside] + reach] += (light * part)[inside]
    kernel[reach, reach] = glare.alpha
    return np.asarray(kernel / kernel.sum(), np.float32)


def draw_angle_rad(glare: GlareRecipe, rng: np.random.Generator) -> float:
    """Draw an angle, to either side alike.

    The thesis prints its range in radians; +-(2.5..8) can only be degrees.
    """
    side = 1 if rng.random() < 0.5 else -1
    return side * math.radians(rng.uniform(glare.angle_min_deg, glare.angle_max_deg))

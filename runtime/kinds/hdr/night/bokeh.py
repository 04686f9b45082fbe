"""Lamps out of focus: discs with a rim, cut to cat's eyes towards the corners of the picture."""

from typing import Final

import numpy as np

from camkit.runtime.kinds.hdr.night.canvas import Canvas, disc, glow, patch_around
from camkit.runtime.kinds.hdr.night.facade import draw_wall
from camkit.runtime.kinds.hdr.night.lamp import draw_neon, draw_power, draw_white
from camkit.scenes.texture import Generator, sample_texture

CAT_EYE: Final = 0.7
MOST_DISC_POWER: Final = 60.0
BLUR_PX: Final = 28


def add_bokeh(rng: Generator, canvas: Canvas, cy: float, cx: float, radius: float) -> float:
    """Draw a lamp that is out of focus, and return the brightness of its disc.

    Args:
        rng: Draws colour, brightness and rim.
        canvas: Painted in place.
        cy: Row of its middle.
        cx: Its column.
        radius: Of the disc, in pixels.
    """
    patch = patch_around(canvas, cy, cx, radius + 1)
    if patch is None:
        return 0.0
    height, width = canvas.size
    half = np.hypot(height, width) / 2
    out_y, out_x = (cy - height / 2) / half, (cx - width / 2) / half
    alpha = disc(patch, radius)
    # the rim of the front lens cuts the disc on the side that is turned away from the middle
    shift = radius * CAT_EYE * np.float32(1)
    distance = np.hypot(patch.dy + shift * out_y, patch.dx + shift * out_x)
    alpha = np.minimum(alpha, np.clip(np.float32(radius + 0.5) - distance, 0, 1))
    rim = np.minimum(np.hypot(patch.dy, patch.dx) / np.float32(radius), 1) ** 6
    profile = alpha * (1 - np.float32(rng.uniform(0.0, 0.4)) * (1 - rim))
    colour = draw_white(rng) if rng.random() < 0.7 else draw_neon(rng)
    # the same lamp is the dimmer, the larger its disc
    most = max(2.0, MOST_DISC_POWER * min(1.0, (6 / radius) ** 1.2))
    power = draw_power(rng, 0.15, most)
    glow(canvas, patch, (colour * power)[:, None, None] * profile)
    return float(power)


def add_blur(rng: Generator, canvas: Canvas) -> None:
    """Draw soft surfaces over the whole picture: the rest of a scene out of focus.

    Args:
        rng: Draws their colours and places.
        canvas: Painted in place.
    """
    height, width = canvas.size
    places = [(np.arange(side) + rng.integers(4096)) / BLUR_PX for side in (height, width)]
    # enlarged many times, a texture has only its lowest frequencies
    soft = sample_texture(canvas.textures[2], places[0], places[1])
    dark, bright = 0.1 * draw_wall(rng), 0.6 * draw_wall(rng)
    share = np.clip(0.3 + 0.4 * soft, 0, 1)
    for plane, low, high in zip(canvas.surface, dark, bright, strict=True):
        plane[:] = low + (high - low) * share

"""Surface colours of scenes, and textures with the spectrum of natural pictures.

References: Field 1987 (amplitude spectra that fall as 1/f).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray

TEXTURE_SIDE_PX: Final = 512

Generator = np.random.Generator
Colour = NDArray[np.float32]


def draw_count(rng: Generator, mean: float) -> int:
    """Draw the number of things, where `mean` are to be expected."""
    return int(rng.poisson(mean))


def draw_colour(rng: Generator) -> Colour:
    """Draw a surface colour: reflectance from dark to light, saturation mostly low.

    Returns:
        (3,) float32, linear Rec.709, 0..1.
    """
    value = float(np.exp(rng.uniform(np.log(0.01), np.log(0.9))))
    tint = 1 + rng.normal(0, rng.choice([0.05, 0.2, 0.6]), 3)
    return np.clip(value * tint, 0.0, 1.0).astype(np.float32)


def make_texture(rng: Generator, slope: float) -> FloatArray:
    """Make a periodic texture whose amplitude falls as f^-slope.

    Returns:
        (`TEXTURE_SIDE_PX`, `TEXTURE_SIDE_PX`) float32, mean 0, deviation 1.
    """
    side = TEXTURE_SIDE_PX
    fy = np.fft.fftfreq(side)[:, None]
    fx = np.fft.rfftfreq(side)[None, :]
    radius = np.hypot(fy, fx)
    radius[0, 0] = 1.0
    spectrum = np.fft.rfft2(rng.standard_normal((side, side))) * radius**-slope
    spectrum[0, 0] = 0.0
    field = np.fft.irfft2(spectrum, s=(side, side))
    return np.asarray(field / field.std(), dtype=np.float32)


def cut_texture(rng: Generator, texture: FloatArray, height: int, width: int) -> FloatArray:
    """Cut a piece (height, width) of a periodic texture at a random place; it may be repeated."""
    y, x = rng.integers(0, TEXTURE_SIDE_PX, 2)
    if y + height <= TEXTURE_SIDE_PX and x + width <= TEXTURE_SIDE_PX:
        return texture[y : y + height, x : x + width]
    rows = np.arange(y, y + height) % TEXTURE_SIDE_PX
    columns = np.arange(x, x + width) % TEXTURE_SIDE_PX
    return np.asarray(texture[rows[:, None], columns])


def sample_texture(
    texture: FloatArray, y: NDArray[np.float64], x: NDArray[np.float64]
) -> FloatArray:
    """Return a periodic texture between its samples, without a kink at them.

    Args:
        texture: (side, side) float32.
        y: (h,) rows to look at.
        x: (w,) columns to look at.

    Returns:
        (h, w) float32.
    """
    tall = _sampled_axis(texture, y, 0)
    return _sampled_axis(tall, x, 1)


def _sampled_axis(texture: FloatArray, at: NDArray[np.float64], axis: int) -> FloatArray:
    first = np.floor(at).astype(np.intp)
    share = (at - first).astype(np.float32)
    share = share * share * (3 - 2 * share)
    share = share[:, None] if axis == 0 else share
    side = texture.shape[axis]
    low, high = (np.take(texture, (first + step) % side, axis=axis) for step in (0, 1))
    return np.asarray(low + share * (high - low), dtype=np.float32)

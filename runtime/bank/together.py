"""The Wiener filter of all colours together: what is sharp in one colour helps the others.

    x_c = a_c l + d_c        l: light that all colours share, of power S; d_c: what c has of its own
    S = scale m^2 (f^2 + f0^2)^(-exponent / 2) k^follow,   power of d_c: own S a_c^2

A lens blurs its colours differently, and a filter of one colour alone wastes what a sharper one
knows. a_c is the level of a colour over the mean level m of the block, k the measured over the
expected power of the estimate L in the band `BAND`, found with k = 1: a smooth block is given a
weak prior, a block of leaves a strong one. With u_c = a_c H_c and

    D_c = (own |u_c|^2 + mistrust V_c a_c^2) S + N_c,   N_c = variance exp(noise_c + 4 rise_c f^2)

the best linear estimate is

    q = sum conj(u_c) Y_c / D_c,   r = sum |u_c|^2 / D_c,   L = S q / (1 + S r)
    X_c = a_c L + own S a_c^2 conj(H_c) (Y_c - u_c L) / D_c

V_c is the variance of the transfer over fabricated copies at the block's field height: what the
frozen transfer cannot promise counts as noise that grows with the scene. Frequency 0 stays.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages import Together
from camkit.bundle.stages.together import BAND, BAND_STEP, Spread
from camkit.contracts import FloatArray
from camkit.runtime.bank.spectrum import ComplexArray, inverse, transform

CORNER_FREQUENCY: Final = 1 / 512
"""f0 in cycles/pixel: below it the prior no longer rises."""
LEAST_SHARE: Final = 1e-3
"""Of the mean level: a colour darker than that is taken to be as bright."""
LEAST_MEASURED: Final = 1e-6
COARSE: Final = np.s_[..., ::BAND_STEP, ::BAND_STEP]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """What depends on the size of a block alone; arrays of its half spectrum are float32.

    Attributes:
        fall: S for a scale and level of one.
        noise: (c, ...) N for a variance of one.
        band: Of the coarse frequencies, those measured.
        low: Number of the table's frequency below each one.
        part: How far each lies from there to the next.
    """

    fall: FloatArray
    noise: FloatArray
    band: NDArray[np.bool_]
    low: NDArray[np.intp]
    part: FloatArray


@lru_cache(maxsize=4)
def shapes_of(together: Together, block_px: int) -> Shapes:
    """Give the shapes of a block."""
    fy, fx = np.fft.fftfreq(block_px)[:, None], np.fft.rfftfreq(block_px)[None, :]
    f2 = fy * fy + fx * fx
    samples = float(block_px) ** 2
    fall = samples * (f2 + CORNER_FREQUENCY**2) ** (-together.exponent / 2)
    lines = zip(together.noise, together.noise_rise, strict=True)
    noise = samples * np.exp(np.stack([n + 4 * rise * f2 for n, rise in lines]))
    coarse = f2[COARSE]
    places = np.array(together.spread.frequencies)
    at = np.minimum(np.sqrt(f2), places[-1])
    low = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
    return Shapes(
        fall=fall.astype(np.float32),
        noise=noise.astype(np.float32),
        band=np.asarray((coarse >= BAND[0] ** 2) & (coarse <= BAND[1] ** 2)),
        low=low,
        part=((at - places[low]) / (places[low + 1] - places[low])).astype(np.float32),
    )


def spread_at(spread: Spread, height_mm: float, shapes: Shapes) -> FloatArray:
    """Give V of a field height, (c, b, b // 2 + 1); linear between the table's places."""
    table, heights = _table(spread)
    place = float(np.interp(height_mm, heights, np.arange(len(heights))))
    below = min(int(place), max(len(heights) - 2, 0))
    above = min(below + 1, len(heights) - 1)
    lines = (table[below] + (place - below) * (table[above] - table[below])).astype(np.float32)
    steps = np.diff(lines, axis=1)
    return np.stack(
        [
            line[shapes.low] + step[shapes.low] * shapes.part
            for line, step in zip(lines, steps, strict=True)
        ]
    )


@lru_cache(maxsize=4)
def _table(spread: Spread) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the variances (height, colour, frequency), and the heights in mm."""
    return np.array(spread.variance, np.float64), np.array(spread.heights_mm, np.float64)


def restore_together(
    samples: FloatArray,
    otf: ComplexArray,
    *,
    level: NDArray[np.float64],
    variance: NDArray[np.float64],
    height_mm: float,
    together: Together,
) -> FloatArray:
    """Deconvolve a periodic block.

    Args:
        samples: (c, b, b) float32.
        otf: (c, b, b // 2 + 1).
        level: (c,) > 0, of the block.
        variance: (c,) of its noise.
        height_mm: Field height of the block.
        together: The model.

    Returns:
        (c, b, b) float32.
    """
    block_px = samples.shape[-1]
    shapes = shapes_of(together, block_px)
    mean = float(level.mean())
    share = np.maximum(level / mean, LEAST_SHARE).astype(np.float32)[:, None, None]
    spectrum = transform(samples)
    noise = variance.astype(np.float32)[:, None, None] * shapes.noise
    prior = np.float32(together.scale * mean * mean) * shapes.fall
    power = share * share * (np.square(otf.real) + np.square(otf.imag))
    doubt = spread_at(together.spread, height_mm, shapes)
    doubt *= np.float32(together.mistrust) * share * share
    doubt += np.float32(together.own) * power
    if together.follow:
        seen = _shared(
            spectrum[COARSE],
            otf[COARSE],
            share,
            power[COARSE],
            doubt[COARSE],
            prior[COARSE],
            noise[COARSE],
        )
        measured = _measured(seen, prior[COARSE], shapes.band)
        prior *= np.float32(measured**together.follow)
    found = _shared(spectrum, otf, share, power, doubt, prior, noise)
    light = found.light
    rest = share * otf
    rest *= light
    np.subtract(spectrum, rest, out=rest)
    rest *= found.taken
    rest *= np.float32(together.own) * prior
    rest += light
    rest *= share
    rest[:, 0, 0] = spectrum[:, 0, 0]
    return inverse(rest, block_px)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shared:
    """The light that all colours share.

    Attributes:
        light: L.
        seen: r.
        taken: (c, ...) conj(u_c) / D_c.
    """

    light: ComplexArray
    seen: FloatArray
    taken: ComplexArray


def _shared(
    spectrum: ComplexArray,
    otf: ComplexArray,
    share: FloatArray,
    power: FloatArray,
    doubt: FloatArray,
    prior: FloatArray,
    noise: FloatArray,
) -> _Shared:
    weight = doubt * prior
    weight += noise
    np.reciprocal(weight, out=weight)
    seen = np.einsum("cij,cij->ij", power, weight)
    weight *= share
    taken = np.conj(otf)
    taken *= weight
    light = np.einsum("cij,cij->ij", taken, spectrum)
    light *= prior / (1 + prior * seen)
    return _Shared(light=light, seen=seen, taken=taken)


def _measured(found: _Shared, prior: FloatArray, band: NDArray[np.bool_]) -> float:
    """Give the measured over the expected power of the light."""
    light, seen, scene = found.light[band], found.seen[band], prior[band]
    expected = scene * scene * seen / (1 + scene * seen)
    measured = np.square(light.real) + np.square(light.imag)
    total = float(expected.sum(dtype=np.float64))
    if total <= 0:
        return 1.0
    return max(float(measured.sum(dtype=np.float64)) / total, LEAST_MEASURED)

"""The Wiener filter of all colours together: what is sharp in one colour helps the others.

    x_c = a_c l + d_c        l: light that all colours share, of power S; d_c: what c has of its own
    S = s F,   F = (f^2 + f0^2)^(-exponent / 2),   s = scale m^2 k^follow
    power of d_c: own S a_c^2

A lens blurs its colours differently, and a filter of one colour alone wastes what a sharper one
knows. a_c is the level of a colour over the mean level m of the block, k the measured over the
expected power of the estimate L in the band `BAND`, found with k = 1: a smooth block is given a
weak prior, a block of leaves a strong one. With the transfer H_c and

    D_c = (own |H_c|^2 + mistrust V_c) F + variance / (a_c^2 s) exp(noise_c + 4 rise_c f^2)
    G_c = conj(H_c) Y_c / D_c,   Q_c = |H_c|^2 F / D_c

the best linear estimate is

    L = F / (1 + sum Q_c) sum G_c / a_c
    X_c = a_c (1 - own Q_c) L + own F G_c

All weights but conj(H_c) are real, so everything is done in packed planes (`spectrum`). V_c is the
variance of the transfer over fabricated copies at the block's field height: what the frozen
transfer cannot promise counts as noise that grows with the scene. Frequency 0 stays.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Together
from camkit.bundle.stages.together import BAND, BAND_STEP, Spread
from camkit.runtime.bank.spectrum import (
    ComplexArray,
    from_packed,
    multiply_conjugate,
    packed_places,
    packed_power,
    packed_spectrum,
    spread_weights,
    to_packed,
)

CORNER_FREQUENCY: Final = 1 / 512
"""f0 in cycles/pixel: below it the prior no longer rises."""
LEAST_SHARE: Final = 1e-3
"""Of the mean level: a colour darker than that is taken to be as bright."""
LEAST_MEASURED: Final = 1e-6
BINNED_NOISE: Final = 0.7
"""Logarithm of the noise of means over squares of a mosaic: detail that they fold back counts as
noise (judged on valid_open, docs/results/plan.md); it is white, no demosaicking has shaped it."""

Places = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lookup:
    """The frequencies of a grid among those of the spread's table.

    Attributes:
        number: Which of the distinct frequencies lies where in the grid.
        low: (f,) number of the table's frequency below each distinct one.
        part: (f,) how far each lies from there to the next.
    """

    number: Places
    low: Places
    part: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Shapes:
    """The terms that depend on the size of a block alone; float32.

    Attributes:
        fall: (b, b) F, times the samples of a block; for packed planes.
        noise: (c, b, b) noise for a variance of one, times those samples; for packed planes.
        lookup: Of the frequencies in a packed plane.
        band: Places of the real and imaginary parts of the frequencies that are measured, in packed
            planes.
        band_fall: (n,) F there, times the samples.
        band_noise: (c, n) the noise there.
    """

    fall: FloatArray
    noise: FloatArray
    lookup: Lookup
    band: tuple[Places, Places]
    band_fall: FloatArray
    band_noise: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """The terms that depend on the place of a block too; (c, b, b) float32, packed planes.

    Attributes:
        otf: H.
        power: |H|^2 F.
        doubt: (own |H|^2 + mistrust V) F.
        band_power: (c, n) of the frequencies that are measured.
        band_doubt: Likewise.
    """

    otf: FloatArray
    power: FloatArray
    doubt: FloatArray
    band_power: FloatArray
    band_doubt: FloatArray


def binned_model(model: Together, side_px: int) -> Together:
    """Return the model for means over squares, from that for demosaicked pixels.

    Args:
        model: Fitted to pixels.
        side_px: Side of a square in pixels.
    """
    frequencies = tuple(frequency * side_px for frequency in model.spread.frequencies)
    return model.model_copy(
        update={
            "spread": model.spread.model_copy(update={"frequencies": frequencies}),
            "noise": (BINNED_NOISE,) * len(model.noise),
            "noise_rise": (0.0,) * len(model.noise_rise),
        }
    )


@lru_cache(maxsize=4)
def shapes_of(model: Together, block_px: int) -> Shapes:
    """Return the shapes of a block."""
    fy, fx = np.fft.fftfreq(block_px)[:, None], np.fft.rfftfreq(block_px)[None, :]
    f2 = fy * fy + fx * fx
    samples = float(block_px) ** 2
    fall = (samples * (f2 + CORNER_FREQUENCY**2) ** (-model.exponent / 2)).astype(np.float32)
    lines = zip(model.noise, model.noise_rise, strict=True)
    noise = samples * np.exp(np.stack([n + 4 * rise * f2 for n, rise in lines]))
    lookup = lookup_of(model.spread, f2)
    steps = [np.arange(0, side, BAND_STEP) for side in f2.shape]
    rows, columns = np.meshgrid(*steps, indexing="ij")
    in_band = (f2[rows, columns] >= BAND[0] ** 2) & (f2[rows, columns] <= BAND[1] ** 2)
    band = packed_places(rows[in_band], columns[in_band], (block_px, block_px))
    spread_fall = spread_weights(fall[None], block_px)
    spread_noise = spread_weights(noise.astype(np.float32), block_px)
    # float32 holds the numbers exactly: a block has far fewer frequencies than 2^24
    spread_number = spread_weights(lookup.number[None].astype(np.float32), block_px)
    return Shapes(
        fall=spread_fall[0],
        noise=spread_noise,
        lookup=replace(lookup, number=spread_number[0].astype(np.intp)),
        band=band,
        band_fall=_at(spread_fall, band[0])[0],
        band_noise=_at(spread_noise, band[0]),
    )


def lookup_of(spread: Spread, f2: NDArray[np.float64]) -> Lookup:
    """Return where the squared frequencies of a grid lie in the table of a spread."""
    places = np.array(spread.frequencies)
    distinct, number = np.unique(f2, return_inverse=True)
    at = np.minimum(np.sqrt(distinct), places[-1])
    low = np.clip(np.searchsorted(places, at, side="right") - 1, 0, len(places) - 2)
    part = ((at - places[low]) / (places[low + 1] - places[low])).astype(np.float32)
    return Lookup(number=number.reshape(f2.shape), low=low, part=part)


def transfer_of(otf: ComplexArray, height_mm: float, model: Together) -> Transfer:
    """Return the terms of the filter for a place.

    Args:
        otf: (c, b, b // 2 + 1) complex64.
        height_mm: Its field height.
        model: The model.
    """
    block_px = otf.shape[1]
    shapes = shapes_of(model, block_px)
    packed = packed_spectrum(otf, block_px)
    power = packed_power(packed)
    doubt = spread_at(model.spread, height_mm, shapes.lookup, np.float32(model.mistrust))
    doubt += np.float32(model.own) * power
    doubt *= shapes.fall
    power *= shapes.fall
    return Transfer(
        otf=packed,
        power=power,
        doubt=doubt,
        band_power=_at(power, shapes.band[0]),
        band_doubt=_at(doubt, shapes.band[0]),
    )


def spread_at(spread: Spread, height_mm: float, lookup: Lookup, mistrust: np.float32) -> FloatArray:
    """Return mistrust V of a field height, (c, *grid); linear between the table's places."""
    table, heights = _table(spread)
    place = float(np.interp(height_mm, heights, np.arange(len(heights))))
    below = min(int(place), max(len(heights) - 2, 0))
    above = min(below + 1, len(heights) - 1)
    lines = (table[below] + (place - below) * (table[above] - table[below])).astype(np.float32)
    steps = np.diff(lines, axis=1)
    doubt: FloatArray = steps.take(lookup.low, axis=1)
    doubt *= lookup.part
    doubt += lines.take(lookup.low, axis=1)
    doubt *= mistrust
    return doubt.take(lookup.number, axis=1)


@lru_cache(maxsize=4)
def _table(spread: Spread) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the variances (height, colour, frequency), and the heights in mm."""
    return np.array(spread.variance, np.float64), np.array(spread.heights_mm, np.float64)


def restore_together(
    samples: FloatArray,
    transfer: Transfer,
    *,
    level: NDArray[np.float64],
    variance: NDArray[np.float64],
    model: Together,
) -> FloatArray:
    """Deconvolve a periodic block.

    Args:
        samples: (c, b, b) float32.
        transfer: Of its place.
        level: (c,) > 0, of the block.
        variance: (c,) of its noise.
        model: The model.

    Returns:
        (c, b, b) float32.
    """
    shapes = shapes_of(model, samples.shape[-1])
    mean = float(level.mean())
    share = np.maximum(level / mean, LEAST_SHARE)
    scale = model.scale * mean * mean
    spectrum = to_packed(samples)
    crossed = multiply_conjugate(spectrum, transfer.otf)
    noise = variance / (share * share * scale)
    if model.follow:
        noise /= _measured(crossed, transfer, shapes, (share, noise, scale)) ** model.follow
    zero, planes = spectrum[:, 0, 0].copy(), spectrum
    light, rest = np.zeros_like(shapes.fall), np.ones_like(shapes.fall)
    for c, buffer in enumerate(planes):  # plane by plane: what is at hand stays in cache
        cv2.scaleAdd(shapes.noise[c], float(noise[c]), transfer.doubt[c], dst=buffer)
        np.reciprocal(buffer, out=buffer)
        np.multiply(crossed[c], buffer, out=crossed[c])
        cv2.scaleAdd(crossed[c], float(1 / share[c]), light, dst=light)
        np.multiply(buffer, transfer.power[c], out=buffer)
        np.add(rest, buffer, out=rest)
    light *= np.divide(shapes.fall, rest, out=rest)
    prior = np.multiply(shapes.fall, np.float32(model.own), out=rest)
    for c, plane in enumerate(planes):
        np.multiply(plane, np.float32(-model.own * share[c]), out=plane)
        np.add(plane, np.float32(share[c]), out=plane)
        np.multiply(plane, light, out=plane)
        np.multiply(crossed[c], prior, out=crossed[c])
        np.add(plane, crossed[c], out=plane)
    planes[:, 0, 0] = zero
    return from_packed(planes)


def _measured(
    crossed: FloatArray,
    transfer: Transfer,
    shapes: Shapes,
    block: tuple[NDArray[np.float64], NDArray[np.float64], float],
) -> float:
    """Return the measured over the expected power of the light, in the band.

    Args:
        crossed: (c, b, b) conj(H) Y.
        transfer: Of the place.
        shapes: Of the block's size.
        block: (c,) a, (c,) variance / (a^2 s) and s for k = 1.
    """
    share, noise, scale = block
    weight = noise[:, None] * shapes.band_noise
    weight += transfer.band_doubt
    snr = (transfer.band_power / weight).sum(axis=0)
    fall = shapes.band_fall / (1 + snr)
    weight *= share[:, None]
    lights = [(_at(crossed, places) / weight).sum(axis=0) * fall for places in shapes.band]
    measured = sum(np.dot(light, light) for light in lights)
    expected = scale * np.dot(fall, snr)
    return max(float(measured / expected), LEAST_MEASURED) if expected > 0 else 1.0


def _at(planes: FloatArray, places: Places) -> FloatArray:
    """Return the samples (c, n) of planes at some places."""
    return planes.reshape(len(planes), -1).take(places, axis=1)

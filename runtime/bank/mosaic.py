"""The Wiener filter on the mosaic: colours, and what their sampling folds onto them, in one solve.

A mosaic samples each colour too coarsely: at every frequency k of its planes (R, the green beside
it, the green below it, B; half the block's side) four frequencies k_s of the scene lie on each
other. With the model of `joint_colours` (light l, powers S F and own S a_c^2, transfer H_c, its
variance V_c) and sigma_ps the sign with which plane p sees alias s,

    Y_p / a_c = sum_s sigma_ps H_c(k_s) X_c(k_s) / (4 a_c) + noise,   n = half the side
    K_pq = sum_s sigma_ps sigma_qs F_s [ H_c H_c'* (1 + own [c = c']) + [c = c'] mistrust V_c ] / 16
    z = (K + n^2 variance_c / (a_c^2 s))^-1 Y / a_c
    t_c = sum_{p of c} sigma_ps H_c* z_p / 4,   X_c(k_s) = a_c F_s (sum t + own t_c)

The phase of a plane's place is taken off Y first, so K is the same wherever red lies: one for a
place and those that mirror it. Sum and difference of the greens (+, -) see two aliases each, which
leaves a 2x2 system of R and B to solve. The noise is that of the sensor's samples, so `noise` and
`noise_rise`, which describe what a demosaic does to it, are not used. Means are taken off first and
put back.

    s = scale m^2 k^follow min(1, k / smooth_below)^smooth_follow

with k the measured over the expected power of L at the low alias, in the whole of `BAND`: the
spectrum of a smooth block falls faster than F, and what is high in it is noise.

References: Soulez and Thiebaut 2009 (joint deconvolution and demosaicing); Sun 2021, eq. (2.9), for
one full plane.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages import Mosaic, Together
from camkit.runtime.bank.joint_colours import (
    CORNER_FREQUENCY,
    LEAST_MEASURED,
    LEAST_SHARE,
    Lookup,
    lookup_of,
    spread_at,
)
from camkit.runtime.bank.spectrum import ComplexArray, from_packed, packed_spectrum, transform

BAND: Final = (0.06, 0.25)
"""Cycles per pixel in which the power of a block is measured: what lies below tells little of what
lies above."""
ALIASES: Final = ((0, 0), (0, 1), (1, 0), (1, 1))
"""(rows, columns) by which an alias lies higher, in units of the planes' sampling frequency."""
GREENS: Final = (1, 2, 2, 1)
"""Number among (R, +, -, B) of the greens that see an alias."""
ROOT: Final = 2**0.5
SIGNS: Final = ((1.0, 1.0, 1.0, 1.0), (ROOT, -ROOT, ROOT, -ROOT), (1.0, -1.0, -1.0, 1.0))
"""With which R, those greens and B see the aliases, red at the origin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AliasShapes:
    """The terms that depend on the size of a block alone; n is half its side, h = n // 2 + 1.

    Attributes:
        rows: (4, n) rows of the aliases in a half spectrum of the block.
        columns: Their columns, h of them each.
        fall: (4, n, h) F, times the samples of a block; float32.
        lookup: Of the frequencies (4, n, h).
        band: (n, h) F squared of the low alias where it is measured, as often as it is there.
    """

    rows: NDArray[np.intp]
    columns: tuple[slice, ...]
    fall: FloatArray
    lookup: Lookup
    band: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MosaicTransfer:
    """The terms that depend on the place of a block too; float32, complex values as (2, ...).

    Attributes:
        sharp: (2, 3, 4, n, h) F conj(H) with its sign, of (colour, alias).
        low: (2, 4, n, h) H of the low alias as R, +, -, B see it.
        power: (4, n, h) K of R, +, -, B with themselves.
        cross: (2, 2, 2, n, h) K of (R, B) with (+, -).
        cross_power: (2, 2, n, h) its squared absolute value.
        red_blue: (2, n, h) K of R with B.
        detour: (2, 2, n, h) K of R with B by way of (+, -), times the power of those.
    """

    sharp: FloatArray
    low: FloatArray
    power: FloatArray
    cross: FloatArray
    cross_power: FloatArray
    red_blue: FloatArray
    detour: FloatArray


@lru_cache(maxsize=4)
def alias_shapes(model: Together, block_px: int) -> AliasShapes:
    """Return the shapes of a block of even side."""
    n = block_px // 2
    down, across = _signed(n), np.arange(n // 2 + 1)
    # what lies beyond the half spectrum is the mirror image of what is in it
    rows = np.array([(1 - 2 * dx) * (down + n * dy) % block_px for dy, dx in ALIASES])
    columns = tuple(
        slice(n, n - len(across), -1) if dx else slice(len(across)) for _, dx in ALIASES
    )
    fy = np.fft.fftfreq(block_px)[rows][:, :, None]
    fx = np.stack([np.fft.rfftfreq(block_px)[part] for part in columns])[:, None, :]
    f2 = fy * fy + fx * fx
    fall = float(block_px) ** 2 * (f2 + CORNER_FREQUENCY**2) ** (-model.exponent / 2)
    often = np.where((across == 0) | (2 * across == n), 1.0, 2.0)
    band = np.where((f2[0] >= BAND[0] ** 2) & (f2[0] < BAND[1] ** 2), fall[0] ** 2 * often, 0)
    return AliasShapes(
        rows=rows,
        columns=columns,
        fall=fall.astype(np.float32),
        lookup=lookup_of(model.spread, f2),
        band=band.astype(np.float32),
    )


def _signed(n: int) -> NDArray[np.intp]:
    """Return the frequencies of a line of n samples, so that the first alias is the low one."""
    return (np.arange(n) + n // 2) % n - n // 2


def mosaic_transfer(otf: ComplexArray, height_mm: float, model: Together) -> MosaicTransfer:
    """Return the terms of the filter for a place.

    Args:
        otf: (3, b, b // 2 + 1) complex64, b even.
        height_mm: Its field height.
        model: The model; neither `noise` nor `noise_rise` of it is used.
    """
    shapes = alias_shapes(model, otf.shape[1])
    h = _transfer_at(otf, shapes)
    fh = h * shapes.fall
    alone = spread_at(model.spread, height_mm, shapes.lookup, np.float32(model.mistrust / 16))
    alone[1] *= 2  # sum and difference of two greens, each over the root of 2
    alone *= shapes.fall
    alone += np.float32(1 + model.own) * (h[0] * fh[0] + h[1] * fh[1])
    red, blue = h[:, 0], h[:, 2]
    cross = np.stack([_by_green(colour, fh[:, 1]) for colour in (red, blue)], axis=1)
    low = np.zeros((2, 4, *h.shape[3:]), np.float32)
    low[:, (0, 1, 3)] = h[:, :, 0]
    red_blue = _crossed(red, fh[:, 2]).sum(axis=1)
    fh[1] *= -1
    greens = alone[1, ::3].sum(axis=0), alone[1, 1:3].sum(axis=0)
    return MosaicTransfer(
        sharp=fh,
        low=low,
        power=np.stack([alone[0].sum(axis=0), *greens, alone[2].sum(axis=0)]),
        cross=cross,
        cross_power=np.square(cross).sum(axis=0),
        red_blue=red_blue,
        detour=_crossed(cross[:, 0], cross[:, 1]),
    )


def _transfer_at(otf: ComplexArray, shapes: AliasShapes) -> FloatArray:
    """Return (2, 3, 4, n, h): a quarter of H at the aliases, with the sign it is seen with."""
    h = np.empty((2, 3, *shapes.fall.shape), np.float32)
    for s, (rows, columns) in enumerate(zip(shapes.rows, shapes.columns, strict=True)):
        part = otf.take(rows, axis=1)[:, :, columns]
        for c in range(3):
            sign = np.float32(SIGNS[c][s] / 4)
            np.multiply(part[c].real, sign, out=h[0, c, s])
            # the mirror image of a frequency has the conjugate
            np.multiply(part[c].imag, -sign if ALIASES[s][1] else sign, out=h[1, c, s])
    return h


def _crossed(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a conj(b), complex values as (2, ...)."""
    return np.stack([a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1]])


def _by_green(colour: FloatArray, green: FloatArray) -> FloatArray:
    """Return (2, 2, n, h): sums over the aliases that sum and difference of the greens see."""
    product = _crossed(colour, green)
    return np.stack([product[:, 0] + product[:, 3], product[:, 1] + product[:, 2]], axis=1)


def restore_mosaic(
    samples: FloatArray,
    transfer: MosaicTransfer,
    *,
    red: tuple[int, int],
    level: NDArray[np.float64],
    variance: NDArray[np.float64],
    model: Together,
    mosaic: Mosaic,
) -> FloatArray:
    """Deconvolve a periodic block from the samples of its mosaic.

    Args:
        samples: (3, b, b) float32, b even; looked at where the mosaic has a sample of the colour.
        transfer: Of its place.
        red: (row, column) of the red sample in the block's first cell.
        level: (3,) > 0, of the block.
        variance: (3,) of the noise of its samples.
        model: The model.
        mosaic: How it treats smooth blocks.

    Returns:
        (3, b, b) float32.
    """
    shapes = alias_shapes(model, samples.shape[-1])
    mean = float(level.mean())
    share = np.maximum(level / mean, LEAST_SHARE)
    scale = model.scale * mean * mean
    data, means = _data(samples, red, share)
    noise = (samples.shape[-1] / 2) ** 2 * variance / (share * share * scale)
    measured = _measured(data, transfer, shapes, (noise, scale))
    noise *= max(1.0, mosaic.smooth_below / measured) ** mosaic.smooth_follow
    noise /= measured**model.follow
    solved = _solved(data, transfer, _factors(transfer, noise))
    sharp = _spectrum(solved, transfer, shapes, (red, share, model.own))
    packed = packed_spectrum(sharp, samples.shape[-1])
    packed[:, 0, 0] = means * np.float32(samples.shape[-1] ** 2)
    return from_packed(packed)


def _data(
    samples: FloatArray, red: tuple[int, int], share: NDArray[np.float64]
) -> tuple[FloatArray, FloatArray]:
    """Return (2, 4, n, h) spectra of R, +, -, B over their colour's share, and (3,) means."""
    (y, x), n = red, samples.shape[-1] // 2
    places = (y, x), (y, 1 - x), (1 - y, x), (1 - y, 1 - x)
    planes = np.empty((4, n, n), np.float32)
    for plane, c, (dy, dx) in zip(planes, (0, 1, 1, 2), places, strict=True):
        plane[:] = samples[c, dy::2, dx::2]
    spectrum = transform(planes)
    first = spectrum[:, 0, 0].real / np.float32(n * n)
    means = np.array([first[0], (first[1] + first[2]) / 2, first[3]], np.float32)
    data = np.empty((2, *spectrum.shape), np.float32)
    for p, place in enumerate(places):
        spectrum[p] *= _phases(n, place)
    total, difference = spectrum[1] + spectrum[2], spectrum[1] - spectrum[2]
    parts = (spectrum[0], 1), (total, ROOT / 2), (difference, ROOT / 2), (spectrum[3], 1)
    for p, ((part, factor), c) in enumerate(zip(parts, (0, 1, 1, 2), strict=True)):
        np.multiply(part.real, np.float32(factor / share[c]), out=data[0, p])
        np.multiply(part.imag, np.float32(factor / share[c]), out=data[1, p])
    data[:, (0, 1, 3), 0, 0] = 0
    return data, means


@lru_cache(maxsize=16)
def _phases(n: int, place: tuple[int, int]) -> ComplexArray:
    """Return the phases (n, h) that take off a plane's spectrum where its first sample lies."""
    down, across = _signed(n)[:, None], np.arange(n // 2 + 1)
    phases = np.exp(-1j * np.pi / n * (place[0] * down + place[1] * across))
    return np.asarray(phases, np.complex64)


@dataclass(frozen=True, slots=True)
class _Factors:
    """The inverse of K and noise: greens' (2, n, h), R's and B's (n, h), between them (2, n, h)."""

    greens: FloatArray
    red: FloatArray
    blue: FloatArray
    red_to_blue: FloatArray


def _factors(transfer: MosaicTransfer, noise: NDArray[np.float64]) -> _Factors:
    """Return the inverse: greens eliminated, what is left of R and B inverted."""
    red, green, blue = noise.astype(np.float32)
    greens = np.reciprocal(transfer.power[1:3] + green)
    remainders = [
        power + more - crossed[0] * greens[0] - crossed[1] * greens[1]
        for power, more, crossed in zip(
            transfer.power[::3], (red, blue), transfer.cross_power, strict=True
        )
    ]
    red_to_blue = transfer.red_blue - (transfer.detour * greens).sum(axis=1)
    weight = remainders[0] * remainders[1]
    weight -= red_to_blue[0] * red_to_blue[0]
    weight -= red_to_blue[1] * red_to_blue[1]
    np.reciprocal(weight, out=weight)
    red_to_blue *= weight
    return _Factors(greens, remainders[1] * weight, remainders[0] * weight, red_to_blue)


def _solved(data: FloatArray, transfer: MosaicTransfer, factors: _Factors) -> FloatArray:
    """Return (2, 4, n, h): the inverse times spectra of R, +, -, B."""
    cross, red_to_blue = transfer.cross, factors.red_to_blue
    solved = np.empty_like(data)
    greens = data[:, 1:3] * factors.greens
    rest = data[:, ::3] - _product(cross, greens[:, None]).sum(axis=2)
    red, blue = rest[:, 0], rest[:, 1]
    solved[:, 0] = factors.red * red - _product(red_to_blue, blue)
    solved[:, 3] = factors.blue * blue + _crossed(red, red_to_blue) * np.float32(-1)
    back = _crossed(solved[:, 0][:, None], cross[:, 0]) + _crossed(
        solved[:, 3][:, None], cross[:, 1]
    )
    back *= factors.greens
    np.subtract(greens, back, out=solved[:, 1:3])
    return solved


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a b, complex values as (2, ...)."""
    return np.stack([a[0] * b[0] - a[1] * b[1], a[1] * b[0] + a[0] * b[1]])


def _measured(
    data: FloatArray,
    transfer: MosaicTransfer,
    shapes: AliasShapes,
    block: tuple[NDArray[np.float64], float],
) -> float:
    """Return the measured over the expected power of the light, in the band.

    Args:
        data: (2, 4, n, h) of the block.
        transfer: Of the place.
        shapes: Of the block's size.
        block: (3,) noise and s for k = 1.
    """
    noise, scale = block
    weights = _solved(transfer.low, transfer, _factors(transfer, noise))
    light = _crossed(data, weights).sum(axis=1)
    measured = (np.square(light).sum(axis=0) * shapes.band).sum(dtype=np.float64)
    expected = scale * ((transfer.low * weights).sum(axis=(0, 1)) * shapes.band).sum(
        dtype=np.float64
    )
    return max(float(measured / expected), LEAST_MEASURED) if expected > 0 else 1.0


def _spectrum(
    solved: FloatArray,
    transfer: MosaicTransfer,
    shapes: AliasShapes,
    block: tuple[tuple[int, int], NDArray[np.float64], float],
) -> ComplexArray:
    """Return (3, b, n + 1) complex64, the half spectra of the colours.

    Args:
        solved: (2, 4, n, h).
        transfer: Of the place.
        shapes: Of the block's size.
        block: Place of red, (3,) share of every colour, own.
    """
    (y, x), share, own_power = block
    n = shapes.rows.shape[1]
    spectrum = np.empty((3, 2 * n, n + 1), np.complex64)
    for s, (dy, dx) in enumerate(ALIASES):
        terms = _product(transfer.sharp[:, :, s], solved[:, (0, GREENS[s], 3)])
        light = terms.sum(axis=1)
        terms *= np.float32(own_power)
        terms += light[:, None]
        factor = ((-1) ** (y * dy + x * dx) * share).astype(np.float32)[:, None, None]
        terms[0] *= factor
        terms[1] *= -factor if dx else factor
        spectrum.real[:, shapes.rows[s], shapes.columns[s]] = terms[0]
        spectrum.imag[:, shapes.rows[s], shapes.columns[s]] = terms[1]
    return spectrum

"""Stratified numbers: sub-pixel shifts, points of a disc, wavelengths."""

from math import gcd, isqrt, pi
from typing import Final

import numpy as np
import torch
from numpy.random import Generator
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.models_def.optics.kernel_bank import ChannelResponse

_FINE_STEPS: Final = 1024


def pixel_numbers(rng: Generator, pixels: int, spp: int, *, stratified: bool) -> FloatArray:
    """Draw (pixels, spp, 4) numbers in 0..1: two of the sub-pixel shift, two of the pupil.

    Stratified, each pair has one point in each cell of a grid of spp cells, and the cells of the
    two pairs are put together at random (by k -> a k + b modulo spp, a prime to spp, anew for
    each pixel). Each number by itself is uniform, so means are not biased.
    """
    numbers = rng.random((pixels, spp, 4), dtype=np.float32)
    if not stratified:
        return numbers
    rows = next(d for d in range(isqrt(spp), 0, -1) if spp % d == 0)
    columns = spp // rows
    factors = np.array([a for a in range(1, max(spp, 2)) if gcd(a, spp) == 1], dtype=np.int64)
    sample = np.arange(spp)
    for first in (0, 2):
        factor = rng.choice(factors, size=(pixels, 1))
        cell = (factor * sample + rng.integers(spp, size=(pixels, 1))) % spp
        row, column = np.divmod(cell, columns)
        numbers[..., first] = (numbers[..., first] + row.astype(np.float32)) / rows
        numbers[..., first + 1] = (numbers[..., first + 1] + column.astype(np.float32)) / columns
    return numbers


def to_disc(u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
    """Map the unit square to the unit disc, keeping areas and neighbours.

    References: Shirley and Chiu 1997, A low distortion map between disk and square.
    """
    a, b = 2 * u - 1, 2 * v - 1
    wide = torch.abs(a) > torch.abs(b)
    radius = torch.where(wide, a, b)
    safe = torch.where(radius == 0, 1.0, radius)
    ratio = torch.where(wide, b, a) / safe * (pi / 4)
    angle = torch.where(wide, ratio, pi / 2 - ratio)
    return radius * torch.cos(angle), radius * torch.sin(angle)


def draw_wavelengths(
    rng: Generator, response: ChannelResponse, spp: int, *, stratified: bool
) -> NDArray[np.float64]:
    """Draw (3, spp) wavelengths in um, each colour by its response (linear between its samples).

    Stratified, each of spp equal shares of the colour's light has one wavelength, in increasing
    order.
    """
    waves = response.wavelengths_um
    shares = rng.random((3, spp))
    if stratified:
        shares = (shares + np.arange(spp)) / spp
    if waves.size == 1:
        return np.full((3, spp), waves[0])
    fine = np.linspace(waves[0], waves[-1], _FINE_STEPS)
    waves_um = []
    for row, share in zip(response.response, shares, strict=True):
        density = np.interp(fine, waves, row)
        cumulative = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
        # where nothing is sensed the sum stands still: each level keeps its first wavelength
        levels, first = np.unique(cumulative / cumulative[-1], return_index=True)
        waves_um.append(np.interp(share, levels, fine[first]))
    return np.stack(waves_um)

"""Least squares over landing points: a move of the sensor, or of a part, that brings them back."""

from dataclasses import dataclass

import torch
from torch import Tensor

from camkit.models_def.optics.trace import Rays

Pair = tuple[Tensor, Tensor]


@dataclass(frozen=True, slots=True, kw_only=True)
class Beam:
    """Landing points of copies.

    Attributes:
        points: x and y in mm, each (copy, field, wave, ray).
        slopes: Their change for each mm that the sensor moves away.
        weight: The same shape; 0 for lost rays.
    """

    points: Pair
    slopes: Pair
    weight: Tensor


def beam_of(rays: Rays, weight: Tensor) -> Beam:
    """Return the beam of rays on the sensor."""
    return Beam(points=(rays.x, rays.y), slopes=(rays.l / rays.n, rays.m / rays.n), weight=weight)


def shares(weight: Tensor) -> Tensor:
    """Return weights that sum to 1 in every field, all wavelengths together."""
    return weight / weight.sum((2, 3), keepdim=True).clamp_min(1e-300)


def about_centroid(pair: Pair, share: Tensor) -> Pair:
    """Return points about the centroid of their field."""
    x, y = (value - (share * value).sum((2, 3), keepdim=True) for value in pair)
    return x, y


def product(first: Pair, second: Pair, share: Tensor) -> Tensor:
    """Return the weighted sum (copy,) of products over all rays."""
    return (share * (first[0] * second[0] + first[1] * second[1])).sum((1, 2, 3))


def displacement(beam: Beam, nominal: Beam) -> Pair:
    """Return how far rays land from the same rays of the design; 0 where that has none."""
    has = nominal.weight > 0
    x, y = (
        torch.where(has, now - then, 0.0)
        for now, then in zip(beam.points, nominal.points, strict=True)
    )
    return x, y


def least_shift(points: Pair, beam: Beam) -> Tensor:
    """Return the move of the sensor (copy,) in mm that brings points next to their centroids.

    sum w |p - mean p + s (t - mean t)|^2 over all rays, p the points, t the slopes of the beam.
    """
    share = shares(beam.weight)
    slopes = about_centroid(beam.slopes, share)
    both = product(about_centroid(points, share), slopes, share)
    return -both / product(slopes, slopes, share)

"""Deconvolution of all colours with their edges in the same places: the cross-channel prior.

    sharpest colour first -> least squares with total variation
    every other           -> the same, compared with those before it

A colour c with the light u = x / level is the minimum of

    F = |h * x - y|^2 / (2 V) + tv |D u| + cross sum_e |W_e u|
    W_e u = (u_e D u - u D u_e) / m_e

D are the differences to the next sample down and across, |.| sums their lengths over the samples, V
is the variance of the noise, e is a sharper colour and m_e the brightness of its place, so that
shadows count as lights do. Colours that change by the same share from one sample to the next, D u /
u, cost nothing: edges then lie where the sharper colour has them. F is convex. (Of one F for all
colours at once, a trial made what is sharp follow what is blurred.)

With K the differences and the comparisons one below the other, a round is

    x <- argmin |h * x - y|^2 / 2 + <K x, 2 p - p'> + |x - x'|^2_M / 2      x', p': a round before
    p <- p + rho K x, every length cut to its weight

It converges where M >= rho K^T K. |W_e x|^2 <= 2 max|u_e / m_e|^2 |D x|^2 + 2 max|D u_e / m_e|^2
|x|^2, so M may be D^T D and the identity with these weights: the first line is a division of
spectra, and without the prior M is rho D^T D and a round is one of ADMM with total variation.

References: Heide et al. 2013, "High-quality computational imaging through simple lenses" (the
prior, one colour after the other, of first and second differences by their absolute values);
Chambolle and Pock 2011 (primal-dual rounds).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, BlockFilter
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer, inverse, transform
from camkit.runtime.bank.total_variation import (
    backward,
    differences,
    gradient_power,
    light_of_block,
)

CROSS_TV_WEIGHT: Final = 2.5
"""This and the next were tuned behind `duet` (docs/guides/losses.md)."""
CROSS_WEIGHT: Final = 10.0
CROSS_ROUNDS: Final = 30
LEAST_BRIGHTNESS: Final = np.float32(0.05)
"""Of the level; darker places count as this bright."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Other:
    """A sharper colour to be compared with.

    Attributes:
        light: (b, b) u / m.
        steps: (2, b, b) D u / m, down and across.
    """

    light: FloatArray
    steps: FloatArray

    def compared(self, plane: FloatArray) -> FloatArray:
        """Return W x, (2, b, b)."""
        return np.asarray(np.stack(differences(plane)) * self.light - plane * self.steps)

    def back(self, lines: FloatArray) -> FloatArray:
        """Return the adjoint of `compared`, (b, b)."""
        products = np.einsum("dij,dij->ij", lines, self.steps)
        return np.asarray(backward(*(lines * self.light)) - products)

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the weights by which |D x|^2 and |x|^2 bound the square of W x."""
        steps = float(np.square(self.steps).sum(axis=0).max())
        return 2 * float(np.square(self.light).max()), 2 * steps


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Colour:
    """The problem of one colour.

    Attributes:
        samples: (b, b) blurred.
        otf: (b, b // 2 + 1).
        rho: Length of the steps of the duals.
        tv: Weight of |D x|.
        cross: Weight of |W x| for each of the others.
        others: To be compared with; empty for total variation alone.
    """

    samples: FloatArray
    otf: ComplexArray
    rho: float
    tv: float
    cross: float = 0.0
    others: Sequence[Other] = ()

    @property
    def metric(self) -> NDArray[np.float32]:
        """Return M over frequencies, (b, b // 2 + 1)."""
        of_steps, of_light = 1.0, 0.0
        for other in self.others:
            steps, light = other.bounds
            of_steps, of_light = of_steps + steps, of_light + light
        power = gradient_power(len(self.samples))
        return np.asarray(self.rho * (of_steps * power + of_light), dtype=np.float32)

    @property
    def weights(self) -> FloatArray:
        """Return the largest length of each dual, (1 + others, 1, 1)."""
        limits = [self.tv, *(self.cross for _ in self.others)]
        return np.array(limits, dtype=np.float32)[:, None, None]

    def applied(self, plane: FloatArray) -> FloatArray:
        """Return K x, (1 + others, 2, b, b)."""
        steps = np.stack(differences(plane))
        return np.stack([steps, *(other.compared(plane) for other in self.others)])

    def back(self, duals: FloatArray) -> FloatArray:
        """Return K^T p, (b, b)."""
        plane = backward(*duals[0])
        for other, lines in zip(self.others, duals[1:], strict=True):
            plane = plane + other.back(lines)
        return plane

    def cost(self, plane: FloatArray) -> float:
        """Return F of x (b, b), times V."""
        misfit = apply_transfer(plane[None], self.otf[None])[0] - self.samples
        lengths = _lengths(self.applied(plane)).sum(axis=(-2, -1), dtype=np.float64)
        fit = 0.5 * float(np.square(misfit, dtype=np.float64).sum())
        return fit + float((lengths * self.weights[:, 0, 0]).sum())


def compared_with(light: FloatArray) -> Other:
    """Return colour as others are compared with it; m is its brightest sample here or next to here.

    Args:
        light: (b, b) u, 1 at its level.
    """
    bright = np.maximum(np.abs(light), LEAST_BRIGHTNESS)
    down, across = (np.roll(bright, -1, axis=axis) for axis in (0, 1))
    most = np.maximum(bright, np.maximum(down, across))
    steps = np.stack(differences(light))
    light, steps = (np.asarray(part / most, dtype=np.float32) for part in (light, steps))
    return Other(light=light, steps=steps)


def solved(colour: Colour, rounds: int) -> FloatArray:
    """Return x of one colour, (b, b), after some rounds from black."""
    side = len(colour.samples)
    metric, weights = colour.metric, colour.weights
    data = np.conj(colour.otf) * transform(colour.samples[None])[0]
    damping = 1 / (np.square(np.abs(colour.otf)) + metric)
    spectrum, plane = np.zeros_like(data), np.zeros_like(colour.samples)
    duals = old_duals = np.zeros((len(weights), 2, side, side), dtype=np.float32)
    for _ in range(rounds):
        pull = transform(colour.back(2 * duals - old_duals)[None])[0]
        spectrum = (data + metric * spectrum - pull) * damping
        plane = inverse(spectrum[None], side)[0]
        raised = duals + np.float32(colour.rho) * colour.applied(plane)
        keep = np.minimum(weights / np.maximum(_lengths(raised), np.float32(1e-30)), 1)
        old_duals, duals = duals, raised * keep[:, None]
    return plane


def cross_channel_filter(
    noise: NoiseModel,
    *,
    tv_weight: float = CROSS_TV_WEIGHT,
    cross_weight: float = CROSS_WEIGHT,
    rounds: int = CROSS_ROUNDS,
) -> BlockFilter:
    """Return deconvolution with the cross-channel prior as a block filter.

    Args:
        noise: Noise after white balance.
        tv_weight: Strength of the total variation of each colour, tv of F.
        cross_weight: Strength of the prior, cross of F; 0 leaves colours to themselves.
        rounds: Of every colour.
    """
    light = light_of_block(noise)

    def restore(block: Block) -> FloatArray:
        block_light = light(block)
        threshold, rho = (values[:, 0, 0] for values in block_light.splitting(tv_weight))
        # the weights of F times V, and of x in place of u
        cross = cross_weight * block_light.variance / block_light.level
        planes = np.empty_like(block_light.samples)
        sharper: list[Other] = []
        for c in sharpest_first(block.otf):
            colour = Colour(
                samples=block_light.samples[c],
                otf=block.otf[c],
                rho=float(rho[c]),
                tv=float(rho[c] * threshold[c]),
                cross=float(cross[c]),
                others=tuple(sharper),
            )
            planes[c] = solved(colour, rounds)
            if cross_weight > 0:
                sharper.append(compared_with(planes[c] / np.float32(block_light.level[c])))
        return planes

    return restore


def sharpest_first(otf: ComplexArray) -> list[int]:
    """Return the colours of (c, b, b // 2 + 1) transfers by their mean squares, falling."""
    power = np.square(np.abs(otf)).mean(axis=(-2, -1))
    return [int(c) for c in np.argsort(-power, kind="stable")]


def _lengths(lines: FloatArray) -> FloatArray:
    """Return the lengths (n, b, b) of (n, 2, b, b) lines."""
    return np.asarray(np.sqrt(np.square(lines).sum(axis=1)))
